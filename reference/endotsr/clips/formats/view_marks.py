"""Marks on a decoded picture of a video: a stereo pair, a mirror image, a sphere. FFmpeg hands them over.

They come from the container (Matroska's StereoMode, st3d and the matrix of MP4) or from the coded pictures (frame
packing of H.264 and H.265). In: the first picture. Out: a `ViewMarks`.
"""

import struct
from pathlib import Path
from typing import Any, NamedTuple

from endotsr.clips.formats.choices import Stereo
from endotsr.errors import InputError

# Numbers of FFmpeg for the arrangement of a pair.
ARRANGED: dict[int, Stereo] = {1: "side_by_side", 2: "stacked"}
OTHERS = {3: "alternating pictures", 4: "a checkerboard", 5: "side by side in a quincunx", 6: "alternating rows",
          7: "alternating columns"}  # fmt: skip
RIGHT_FIRST = 1  # flag
SAME_SHAPE = 0.02  # relative difference of the shape of a pixel from that of a squeezed view
SPLIT = "use a file with both views side by side or stacked, or with one; --stereo none reads the pictures as one view"


class ViewMarks(NamedTuple):
    """What a video states about the views in its pictures."""

    stereo: Stereo = "none"
    right_first: bool = False  # the right view is on the left or on top
    other: str = ""  # an arrangement that cannot be separated, in words
    mirrored: bool = False  # players show the mirror image of the stored picture


def view_marks(frame: Any, path: Path) -> ViewMarks:
    """The marks of a picture. Raises InputError for the picture of a sphere."""
    found, data = ViewMarks(), {}
    for k in range(len(frame.side_data)):
        data[frame.side_data[k].type.name] = bytes(frame.side_data[k])
    if "SPHERICAL" in data:
        raise InputError(f"{path}: states that its pictures are those of a sphere: use a perspective video")
    if len(pair := data.get("STEREO3D", b"")) >= 8:
        kind, flags = struct.unpack_from("=ii", pair)
        found = ViewMarks(ARRANGED.get(kind, "none"), bool(flags & RIGHT_FIRST), OTHERS.get(kind, ""))
    if len(turn := data.get("DISPLAYMATRIX", b"")) >= 20:
        a, b, _, c, d = struct.unpack_from("=5i", turn)
        found = found._replace(mirrored=a * d - b * c < 0)
    return found


def squeezed(stereo: Stereo, shape: float) -> Stereo:
    """The arrangement with `half_`, if the shape of a pixel (width over height) shows that the views are squeezed."""
    for way, value, half in (("side_by_side", 2.0, "half_side_by_side"), ("stacked", 0.5, "half_stacked")):
        if stereo == way and abs(shape / value - 1) < SAME_SHAPE:
            return half  # type: ignore[return-value]
    return stereo


def chosen_views(marks: ViewMarks, stated: str, path: Path, shape: float = 1.0) -> tuple[Stereo, bool, list[str]]:
    """How the pictures are divided, whether the right view comes first, and notes.

    stated   --stereo: auto follows the mark
    shape    of a pixel, width over height, as the file states it

    Raises:  InputError for a marked arrangement that cannot be separated, unless a way is stated.
    """
    if stated == "auto":
        if marks.other:
            raise InputError(f"{path}: states that its pictures are stereo pairs in {marks.other}; {SPLIT}")
        if marks.stereo == "none":
            return "none", False, []
        order = ", the right view first" if marks.right_first else ""
        found = squeezed(marks.stereo, shape)
        half = (
            "" if found == marks.stereo else f", squeezed to half: restored; --stereo {marks.stereo} keeps the pixels"
        )
        words = f"{path.name} states stereo pairs {marks.stereo.replace('_', ' ')}{order}{half}: read as such"
        return found, marks.right_first, [f"{words}; --stereo none reads one view"]
    chosen: Stereo = stated  # type: ignore[assignment]
    way = chosen.removeprefix("half_")
    if way != marks.stereo and (marks.stereo != "none" or marks.other):
        said = marks.other or marks.stereo.replace("_", " ")
        return chosen, False, [f"{path.name} states stereo pairs, {said}: --stereo {stated} overrides it"]
    return chosen, marks.right_first and way == marks.stereo, []
