"""The viewer page of a recording: one HTML page and one script file per window.

In: the scene of the windows and their frames. Out: PAGE.html and the folder PAGE_windows with 000.js, 001.js, ... The
page loads a window when its time is played and drops the least recently used. It needs no server: browsers allow a page
opened from disk to load scripts, but no other files. In an overlap both windows are drawn; colour, depth and opacity
are blended with the weights of (B18).
"""

import json
from pathlib import Path
from re import fullmatch
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.results.views.page import (
    SECONDS,
    about_frames,
    about_pictures,
    camera_numbers,
    depths_shown,
    encoded,
    held_out_frames,
    page_text,
)
from endotsr.results.views.trajectories import header, key_times, trajectories
from endotsr.studies.windows.scene import WindowedScene, WindowFrames
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.writing import replace_file, replacing_folder

WINDOW_KEYS = 16  # default number of key times per window
DIGITS = 7  # significant digits of camera numbers: single precision


class PageFiles(NamedTuple):
    """Sizes of the written files, bytes."""

    page: int
    windows: list[int]


class Span(NamedTuple):
    """Time span and file of a window."""

    name: str
    frames: str  # as text, "0 to 63"
    begin: float  # time of the recording
    end: float
    file: str  # relative to the page
    count: int  # Gaussians


class HeldOutFrame(NamedTuple):
    """A held-out frame of the recording: its window, and its index among the held-out frames of that window."""

    name: str
    time: float
    window: int
    place: int


class PagePart(NamedTuple):
    """One window of the page."""

    span: Span
    depths: tuple[float, float, float]  # ends of the depth colours, pivot
    held_out: list[HeldOutFrame]
    script: str  # content of its file


def window_files(page: Path) -> Path:
    """The folder of the windows of a page."""
    return page.with_name(f"{page.stem}_windows")


def write_windows_page(
    file: Path, scene: WindowedScene, title: str, keys: int, frames: WindowFrames | None = None
) -> PageFiles:
    """Write the windows, then the page. Each is written completely or not at all.

    keys      maximum number of key times per window
    frames    of the recording; without them the page shows no held-out frames and no error
    returns   the sizes of page and windows

    Only one window is in memory at a time. Windows of an earlier page of this name are replaced.
    Raises: InputError if their folder contains any other file.
    """
    target, parts, sizes = window_files(file), [], []
    _refuse_other_files(target)
    with replacing_folder(target) as folder:
        for k, window in enumerate(scene.plan.windows):
            part = _part(scene, k, keys, frames.of_window(k) if frames else None, target.name)
            (folder / f"{window.name}.js").write_text(part.script, encoding="ascii", newline="\n")
            sizes.append(len(part.script))
            parts.append(part._replace(script=""))
    content = _page(scene, title, parts).encode()
    replace_file(file, lambda temporary: temporary.write_bytes(content))
    return PageFiles(len(content), sizes)


def _refuse_other_files(folder: Path) -> None:
    names = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    other = [name for name in names if not fullmatch(r"\d+\.js", name)]
    if other:
        found = f"{folder}: holds {plain_line(min(other))}, which is no window of a page"
        raise InputError(f"{found}; use another name of the page")


def _part(scene: WindowedScene, k: int, keys: int, sequence: Sequence | None, folder: str) -> PagePart:
    """One window: Gaussians, cameras and held-out pictures as a script, at times of the recording."""
    window, own, count = scene.plan.windows[k], scene.window(k), scene.plan.frames
    local = np.append(own.record.times, 1.0)
    found = trajectories(own, key_times(own, keys))
    pictures = held_out_frames(sequence) if sequence else []
    places = [window.first + int(i) for i in sequence.test_index] if sequence else []
    pictures = [picture._replace(time=g / count) for picture, g in zip(pictures, places, strict=True)]
    numbers = header(found) | {
        "times": ((window.first + np.interp(found.times, local, np.arange(window.count + 1))) / count).tolist(),
        "first": scene.frames.index(window.first),
        "cameras": [[float(f"{x:.{DIGITS}g}") for x in row] for row in camera_numbers(own)],
        "held_out": [picture._asdict() for picture in pictures],
    }
    span = Span(
        window.name, f"{window.first} to {window.end - 1}", window.first / count, window.end / count,
        f"{folder}/{window.name}.js", found.words.shape[2],
    )  # fmt: skip
    held_out = [
        HeldOutFrame(picture.name, picture.time, k, place)
        for place, (picture, g) in enumerate(zip(pictures, places))
        if scene.owner(g) == k
    ]
    script = f'endotsr_window[{k}]({json.dumps(numbers)},"{encoded(found)}");\n'
    return PagePart(span, depths_shown(own), held_out, script)


def _page(scene: WindowedScene, title: str, parts: list[PagePart]) -> str:
    low, high, pivot = np.array([part.depths for part in parts]).T
    gaps = [
        {"begin": gap.first / scene.plan.frames, "end": gap.end / scene.plan.frames, "reason": gap.reason}
        for gap in scene.plan.left_out
    ]
    about = about_frames(scene.record, scene.frames) | about_pictures(scene.window(0), float(np.median(pivot)))
    about |= {
        "count": max(part.span.count for part in parts),
        "depth_range": [float(low.min()), float(high.max())],
        "seconds": SECONDS * len(parts),
        "windows": [part.span._asdict() for part in parts],
        "left_out": gaps,
        "held_out": [frame._asdict() for part in parts for frame in part.held_out],
    }
    return page_text(title, about, "")
