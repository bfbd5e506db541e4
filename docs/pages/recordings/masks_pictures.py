"""Pictures of the guide on masks: the drawing page and the carried masks of a simulated clip.

    python docs/make.py recordings.masks_pictures      about a minute; needs a browser

A headless browser opens the page, draws by mouse around the true masks, and saves the file that is carried. The
pictures are docs/results/masks_page.webp (1400 pixels wide), masks_page_800.webp and masks_carried.webp.
"""

import contextlib
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from endotsr.clips.masks.mask_shapes import shapes_of
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.png import read_png
from endotsr.results.report.figures import encode
from pages.store.commands import said
from pages.store.program import DOCS, RESULTS

SCENE = ("pulling", "--frames", "24")
KEY_FRAMES, DRAWN = 4, 2  # frames of the page, and those that are drawn in the browser
CARRIED_WIDTH = 1280


def corners(mask: Path) -> list[list[list[float]]]:
    """The outlines of a true mask, as a person would click them."""
    return [[list(p) for p in shape.points] for shape in shapes_of(read_png(mask) > 0, "drawn") if not shape.erase]


def saved(file: Path) -> None:
    """Wait for a download."""
    end = time.monotonic() + 60
    while not file.exists():
        if time.monotonic() > end:
            raise TimeoutError(file)
        time.sleep(0.1)


def draw(remote: Any, folder: Path, root: Path) -> None:
    """Draw the first frames with clicks, state the border at the bottom, copy to one more frame, and save."""
    rect = "(({left, top, width}) => [left, top, width])(document.getElementById('picture').getBoundingClientRect())"
    wide = "document.getElementById('picture').clientHeight"
    left, top, width = remote.value(rect)
    scale = remote.value(wide) / 512
    left += (width - 640 * scale) / 2
    names = remote.value("JSON.parse(document.getElementById('about').textContent).frames.map((f) => f.name)")
    for name in names[:DRAWN]:
        for outline in corners(folder / "gt_masks" / f"{name}.png"):
            for x, y in outline:
                remote.click(left + x * scale, top + y * scale)
            remote.key("Enter")
        remote.key(".")
    remote.key("c")
    remote.picture(root / "page.png")
    remote.key(".")
    remote.size(800, 900)
    time.sleep(0.5)
    remote.picture(root / "page_800.png")
    remote.key("s")
    saved(root / "keys.json")


def main(words: list[str]) -> None:
    """The command."""
    sys.path.insert(0, str(DOCS.parent / "tests" / "results" / "views"))
    from remote import Remote  # type: ignore[import-not-found]

    with tempfile.TemporaryDirectory() as temporary, contextlib.chdir(temporary):
        root = Path(temporary)
        scene, clip, page = Path("scene"), Path("clip"), Path("draw.html")  # the page shows these names
        said("simulate", *SCENE, "--out", scene)
        said("prepare", scene, "--out", clip)
        said("masks", clip, "--draw", page, "--key-frames", KEY_FRAMES)
        with Remote(root / "profile") as remote:
            draw(remote.open(root / page, root), scene, root)
        for name in ("page", "page_800"):
            (RESULTS / f"masks_{name}.webp").write_bytes(encode(read_png(root / f"{name}.png"), "webp"))
        said("masks", clip, "--keys", root / "keys.json", "--replace")
        shown = read_png(clip / "proposed_masks.png")
        size = (CARRIED_WIDTH, round(shown.shape[0] * CARRIED_WIDTH / shown.shape[1]))
        (RESULTS / "masks_carried.webp").write_bytes(encode(area_resize(shown, *size), "webp"))
        print(len(json.loads((root / "keys.json").read_text())["keys"]), "keys")
