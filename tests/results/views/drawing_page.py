"""A drawing page of four frames in a browser, addressed by pixels of the picture."""

import time
from pathlib import Path

import numpy as np
from remote import Remote

from endotsr.clips.masks.drawing import Draft, DrawnClip, DrawnFrame
from endotsr.clips.masks.drawn_masks import read_drawn
from endotsr.clips.masks.mask_shapes import MaskShape
from endotsr.clips.sequences.clip import Clip

WIDTH, HEIGHT, STEP, COLUMNS = 320, 240, 16, 20
NAMES = ["000", "</script><img src=x onerror=document.title='taken'>", 'c" onload="x', "003"]
SHIFT = (24.0, 8.0)  # px from one frame of the page to the next


def drawing(shapes: list[MaskShape] | None = None) -> DrawnClip:
    """Four of seven frames; the second one has a draft, the third one may be drawn already."""
    rng = np.random.default_rng(0)
    ahead = np.tile(np.array(SHIFT)[:, None], COLUMNS * (HEIGHT // STEP))
    draft = Draft("colour", [MaskShape(tool="polygon", points=[(200, 20), (300, 20), (300, 90)], origin="colour")])
    frames = []
    for i, name in enumerate(NAMES):
        picture = rng.integers(90, 160, (HEIGHT, WIDTH, 3), np.uint8)
        drawn = (shapes or []) if i == 2 else []
        motion = (ahead if i < 3 else None, -ahead if i else None)
        frames.append(DrawnFrame(2 * i, name, picture, drawn, bool(drawn), draft if i == 1 else None, *motion))
    return DrawnClip(7, WIDTH, HEIGHT, frames, [], STEP, COLUMNS)


def clip() -> Clip:
    names = [NAMES[i // 2] if i % 2 == 0 else f"between {i}" for i in range(7)]
    return Clip("pictures", Path("clip"), names, lambda chosen: iter(()))


class Page:
    """The page in the browser, addressed by pixels of the picture."""

    def __init__(self, remote: Remote, folder: Path) -> None:
        self.remote, self._folder = remote, folder
        box = remote.value("(({left, top, width, height}) => [left, top, width, height])"
                           "(document.getElementById('picture').getBoundingClientRect())")  # fmt: skip
        self._scale = min(box[2] / WIDTH, box[3] / HEIGHT)
        self._left = box[0] + (box[2] - self._scale * WIDTH) / 2
        self._top = box[1] + (box[3] - self._scale * HEIGHT) / 2

    def fit(self) -> float:
        """Pixels of the window for one of the picture, without a zoom."""
        box = self.remote.value("(({width, height}) => [width, height])"
                                "(document.getElementById('picture').getBoundingClientRect())")  # fmt: skip
        return min(box[0] / WIDTH, box[1] / HEIGHT)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """A point of the picture in the window."""
        return self._left + x * self._scale, self._top + y * self._scale

    def polygon(self, *corners: tuple[float, float]) -> None:
        for corner in (*corners, corners[0]):
            self.remote.click(*self.at(*corner))

    def drag(self, *points: tuple[float, float], **how: str) -> None:
        self.remote.drag([self.at(*point) for point in points], **how)

    def keys(self, text: str) -> None:
        for key in text:
            self.remote.key(key)

    def press(self, label: str) -> None:
        """Click a button by its identifier."""
        box = self.remote.value(f"(({{left, top, width, height}}) => [left + width / 2, top + height / 2])"
                                f"(document.getElementById('{label}').getBoundingClientRect())")  # fmt: skip
        self.remote.click(*box)

    def said(self) -> str:
        return self.remote.value("document.getElementById('shown').textContent")

    def saved(self):
        """The file that the page saves, as the package reads it."""
        file = self._folder / "keys.json"
        file.unlink(missing_ok=True)
        self.press("save")
        end = time.monotonic() + 60
        while not (file.exists() and file.stat().st_size):  # the browser reserves the name with an empty file
            assert time.monotonic() < end
            time.sleep(0.05)
        return read_drawn(file, clip(), WIDTH, HEIGHT)
