"""The file of the drawing page: masks of key frames as shapes, and the area that shows tissue in no frame.

    {"format": "endotsr-keys-1",
     "frames": 63, "width": 640, "height": 512,               of the clip
     "keys": [{"frame": 0, "name": "000000", "shapes": []},   an empty list: no instrument in this frame
              {"frame": 9, "name": "000009", "shapes": [
                {"tool": "polygon", "erase": false, "points": [[310.5, 200], ...], "origin": "drawn"},
                {"tool": "brush", "erase": true, "radius": 8, "points": [[320, 210], ...], "origin": "drawn"}]}],
     "never": [...]}                                          shapes that hold for all frames

`mask_shapes` defines what a shape covers. In: the file and its clip. Out: masks, or an InputError that names the key.
"""

from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec

from endotsr.clips.masks.mask_shapes import LARGEST, MaskShape, filled
from endotsr.clips.sequences.clip import Clip
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray
from endotsr.untrusted.json import Count, Text, read_json, typed
from endotsr.untrusted.names import shown
from endotsr.untrusted.sections import Section

FORMAT = "endotsr-keys-1"
LARGEST_FILE = 16 << 20  # bytes
MOST_SHAPES = 1000  # of a frame
MOST_POINTS = 100_000  # of a file
Side = Annotated[int, msgspec.Meta(ge=1, le=LARGEST)]
Shapes = Annotated[list[MaskShape], msgspec.Meta(max_length=MOST_SHAPES)]


class DrawnKey(Section, frozen=True, kw_only=True):
    """The shapes of one frame."""

    frame: Count
    name: Text
    shapes: Shapes


class DrawnFile(Section, frozen=True, kw_only=True):
    """All of the file."""

    format: str
    frames: Count
    width: Side
    height: Side
    keys: list[DrawnKey]
    never: Shapes = msgspec.field(default_factory=list)


class KeyMasks(NamedTuple):
    """Masks of key frames."""

    keys: dict[int, BoolArray]  # frame -> (H, W), True = instrument
    never: BoolArray | None = None  # (H, W) True where no frame shows tissue; None: not stated


def read_drawn(path: Path, clip: Clip, width: int, height: int) -> DrawnFile:
    """The checked content of a file.

    width, height   px, of the pictures of the clip

    Raises:  InputError naming the file, the key and what is allowed: another format, an unknown key, a value that is no
             finite number in its range, another clip, a frame that the clip lacks or that stands twice.
    """
    data = read_json(path, LARGEST_FILE)
    if data.get("format") != FORMAT:
        raise InputError(f"{path}: format: {shown(data.get('format'))} is not allowed; use {FORMAT!r}")
    found = typed(data, DrawnFile, path)
    for key, value, own in (
        ("frames", found.frames, clip.count),
        ("width", found.width, width),
        ("height", found.height, height),
    ):
        if value != own:
            raise InputError(f"{path}: {key}: {value} is that of another clip; this clip has {own}")
    _check_frames(path, found, clip)
    points = sum(len(shape.points) for shapes in (found.never, *(k.shapes for k in found.keys)) for shape in shapes)
    if points > MOST_POINTS:
        raise InputError(f"{path}: {points} points; use at most {MOST_POINTS} in one file")
    return found


def key_masks(found: DrawnFile) -> KeyMasks:
    """The masks of a file."""
    width, height = found.width, found.height
    keys = {key.frame: filled(key.shapes, width, height) for key in found.keys}
    return KeyMasks(keys, filled(found.never, width, height) if found.never else None)


def _check_frames(path: Path, found: DrawnFile, clip: Clip) -> None:
    seen: set[int] = set()
    for i, key in enumerate(found.keys):
        where = f"{path}: keys[{i}]"
        if key.frame >= clip.count:
            raise InputError(f"{where}.frame: {key.frame} is not a frame of the clip; use one of 0 to {clip.count - 1}")
        if key.frame in seen:
            raise InputError(f"{where}.frame: {key.frame} stands twice; use one entry for each frame")
        if key.name != clip.names[key.frame]:
            own = shown(clip.names[key.frame])
            raise InputError(f"{where}.name: {shown(key.name)} is not allowed; frame {key.frame} of the clip is {own}")
        seen.add(key.frame)
