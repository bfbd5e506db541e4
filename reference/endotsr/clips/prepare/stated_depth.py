"""Checks that the depth files of another program contain lengths.

Disparities in pixels and relative inverse depths have values similar to millimetres, but decrease with depth. Five
kinds of evidence contradict lengths: file names, values stretched to the full range, a median outside the range of an
endoscope, the parallax of a stereo pair, and the light. Light comes from the scope, which makes near tissue brighter:
in measured clips the rank correlation of brightness with depth is -0.55 to -0.84, and +0.55 to +0.84 with inverse
depth. Simulated scenes with even light give -0.3 to 0.2.

In: a clip with stated depth. Out: nothing, or an `InputError` with the evidence and the remedy.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.depth import (
    FULL_SCALE,
    depth_facts,
    light_correlation,
    light_finding,
    mark_finding,
    unit_finding,
    usual_depth,
)
from endotsr.clips.sequences.checks.flips import Fit, agreed_disparity, shading_finding, shading_fit, stereo_finding
from endotsr.clips.sequences.checks.kinds import Finding
from endotsr.clips.sequences.clip import Clip
from endotsr.errors import InputError

NAMES = re.compile(r"dispar|(?<![a-z])disp(?![a-z])|inverse|inv_?depth|relative|midas|depth_?anything|(?<![a-z])dpt")
LOOKED_AT = 8  # frames
EXCHANGED = (
    "neighbouring pixels differ far less with the two bytes of each number exchanged; use the order of bytes of"
    " the format, in PNG the high one first"
)
ROUGHER = 4.0  # times the mean difference of neighbours with exchanged bytes
REMEDY = (
    "a disparity is read by `endotsr depth FOLDER --given FILES --kind disparity` after a prepare without --depth, a"
    " relative inverse depth with --kind relative; --trust-depth reads the files as lengths anyway"
)

REMEDY_GIVEN = (
    "--kind relative reads a relative inverse depth, larger = nearer, and --kind disparity a disparity; --trust-depth"
    " reads the files as lengths anyway"
)


def refuse_no_lengths(clip: Clip, chosen: list[int]) -> None:
    """Raises InputError if the stated depth of a clip most likely contains no lengths.

    chosen   the frames to read; the first `LOOKED_AT` are checked
    """
    depth = clip.depth
    if depth is None or depth.stated is None or depth.trusted:
        return
    found = _of_names(depth.stated) or _of_values(clip, depth.stated, chosen[:LOOKED_AT])
    if found:
        raise InputError(f"{depth.stated}: {found}; {REMEDY}")


def refuse_no_lengths_given(clip: Clip) -> None:
    """As `refuse_no_lengths`, for files whose kind is stated as depth: their names and their unit are no evidence."""
    depth = clip.depth
    assert depth is not None and depth.stated is not None
    found = _of_values(clip, depth.stated, list(range(min(LOOKED_AT, clip.count))), with_unit=False)
    if found:
        raise InputError(f"{depth.stated}: {found}; {REMEDY_GIVEN}")


def _of_names(path: Path) -> str:
    names = [path.name, *(file.name for file in sorted(path.iterdir())[:1])] if path.is_dir() else [path.name]
    named = next((name for name in names if NAMES.search(name.lower())), None)
    return f"the name {named} indicates a disparity or a relative depth" if named else ""


def _of_values(clip: Clip, path: Path, frames: list[int], with_unit: bool = True) -> str:
    """Evidence against lengths in the values and in comparison with the pictures; "" without any.

    Raises:  InputError for depth that is upside down or mirrored, whose largest value marks missing depth, or whose
             bytes are exchanged.
    """
    read, masks, where = clip.depth, clip.masks, str(clip.where)
    assert read is not None
    planes: list[NDArray[np.float32]] = []
    light: list[float] = []
    shading: list[Fit] = []
    for i, pair in zip(frames, clip.pictures(frames)):
        plane = read(i)
        if plane is None or not plane.any():
            continue
        planes.append(plane)
        if plane.shape == pair.left.shape[:2]:
            tissue = masks(i) if masks else None
            light.append(light_correlation(pair.left, plane, tissue))
            shading += filter(None, [shading_fit(pair.left, plane, tissue)])
            right = pair.right if clip.calibration is None and len(planes) == 1 else None
            disparity = None if right is None else agreed_disparity(pair.left, right)
            if disparity is not None:
                found = stereo_finding(plane, disparity, where, i)
                _refuse_flipped(found, path)
                if found:
                    return found[0].what
    _refuse_flipped(shading_finding(shading, where), path)
    if not planes:
        return ""
    facts = [depth_facts("", plane, plane / read.scale, None) for plane in planes]
    if marked := mark_finding(facts, where):
        raise InputError(f"{path}: {marked[0].what}: {marked[0].why}; {marked[0].remedy}, or --trust-depth")
    if len(planes) > 2 and (full := _full_scale([plane / read.scale for plane in planes])):
        return full
    unit = [] if clip.arbitrary or not with_unit else unit_finding(usual_depth(facts), where)
    if unit:
        return f"{unit[0].what}; state another unit with --depth-unit and --depth-scale"
    if any(bytes_exchanged(plane / read.scale) for plane in planes):
        raise InputError(f"{path}: {EXCHANGED}, or --trust-depth")
    found = light_finding(light, where)
    return found[0].what if found else ""


def _refuse_flipped(found: list[Finding], path: Path) -> None:
    for flipped in (f for f in found if f.code == "flipped-depth"):
        raise InputError(f"{path}: {flipped.what}; {flipped.remedy}; --trust-depth reads the files anyway")


def _full_scale(stored: list[NDArray[np.float32]]) -> str:
    """Evidence that every frame is stretched to the full range of integers or to [0, 1]; "" without any."""
    highest = [float(plane.max()) for plane in stored]
    if len({round(value) for value in highest}) == 1 and round(highest[0]) in FULL_SCALE:
        return f"the largest number of every frame is {highest[0]:.0f}: the frames are stretched to the full range"
    if all(0.99 <= value <= 1.0 for value in highest):
        return "the largest number of every frame is 1: the frames are stretched to the full range"
    return ""


def bytes_exchanged(stored: NDArray[np.float32]) -> bool:
    """Whether a plane (H, W) of 16-bit integers varies far less between neighbours with its bytes exchanged.

    Multiples of 256 do so rightly, and are left to the check of the unit.
    """
    whole = np.rint(stored)
    if np.abs(stored - whole).max() > 1e-2 or not 0 < whole.max() <= FULL_SCALE[1] or not (whole % 256).any():
        return False
    levels = whole.astype(np.uint16)
    rough, other = (np.abs(np.diff(plane.astype(np.int32), axis=1)).mean() for plane in (levels, levels.byteswap()))
    return bool(rough > ROUGHER * other)
