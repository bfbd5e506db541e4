"""Survey of a recording, frame by frame: damaged frames, cuts, and tissue motion.

In: a folder that `train` accepts, and the settings of section `sequence`. Out: one `SurveyedFrame` per selected frame.
Only two frames are in memory at a time.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.effects.frames import WIDEST
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import describe_for_training, without_faults
from endotsr.clips.sequences.splits import parse_frame_range
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import CameraPose, degrees_between

LEAST_CORRELATION = 0.5  # of successive frames after warping along the flow; a lower value is a cut
LARGEST_STEP = 0.1  # camera translation between successive frames, fraction of the depth; a larger one is a cut
LARGEST_TURN = 10.0  # camera rotation between successive frames, degrees; a larger one is a cut
LEAST_PIXELS = 100  # tissue pixels common to both frames; with fewer, motion and correlation are not measured


class SurveyedFrame(NamedTuple):
    """The measurements of one frame."""

    name: str
    fault: str = ""  # why the frame cannot be read, one line
    cut: str = ""  # why another scene begins with this frame, as text
    tissue: float = 0.0  # fraction of the pixels
    motion: float = 0.0  # median tissue flow from the previous frame, fraction of the width


class _Shown(NamedTuple):
    """One frame at working size."""

    grey: NDArray[np.uint8]  # (h, w)
    mask: BoolArray  # (h, w) True = tissue
    pose: CameraPose | None
    depth: float | None  # median over the tissue, recording units


def survey(source: Path, config: SequenceConfig) -> list[SurveyedFrame]:
    """Read every selected frame once.

    Motion and cuts are measured between successive readable frames. A frame begins another scene if, after warping
    along the flow, its correlation with the previous frame is below 0.5, or if the camera translates by more than 10 %
    of the depth or rotates by more than 10 degrees.

    Raises: InputError for a folder that `train` does not accept, and for a recording of arbitrary unit, because each
            window would have its own scale. An unreadable frame raises nothing; `fault` gives the reason.
    """
    clip = without_faults(describe_for_training(source, config))
    if clip.arbitrary:
        raise InputError(f"{source}: its unit is arbitrary, so each window would have its own scale; use mm")
    try:
        frames = parse_frame_range(config.frames, clip.count)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return list(_surveyed(clip, frames))


def _surveyed(clip: Clip, frames: range) -> Iterator[SurveyedFrame]:
    before: _Shown | None = None
    for i in frames:
        found, shown = SurveyedFrame(clip.names[i]), None
        try:
            shown = _shown(clip, i)
        except InputError as error:
            found = found._replace(fault=str(error))
        if shown is not None:
            found = found._replace(tissue=float(shown.mask.mean()))
            if before is not None:
                found = found._replace(**_between(before, shown))
        before = shown
        yield found


def _shown(clip: Clip, i: int) -> _Shown:
    """Frame i. Raises InputError if one of its files cannot be read."""
    picture = next(iter(clip.pictures([i]))).left
    intrinsics = clip.intrinsics
    if intrinsics is not None and picture.shape[:2] != (intrinsics.height, intrinsics.width):
        size = f"{picture.shape[1]}x{picture.shape[0]}"
        raise InputError(f"{clip.names[i]}: {size} pixels, the recording has {intrinsics.width}x{intrinsics.height}")
    mask = clip.masks(i) if clip.masks is not None else None
    tissue = np.ones(picture.shape[:2], bool) if mask is None else mask
    depth = None if clip.depth is None else clip.depth(i)
    known = np.empty(0) if depth is None else depth[tissue & (depth > 0)]
    grey, small = _reduced(picture.mean(axis=2).round().astype(np.uint8), tissue)
    pose = None if clip.poses is None else clip.poses[i]
    return _Shown(grey, small, pose, float(np.median(known)) if known.size else None)


def _reduced(grey: NDArray[np.uint8], tissue: BoolArray) -> tuple[NDArray[np.uint8], BoolArray]:
    """Reduce to working size, at most `WIDEST` columns; a pixel is tissue if all covered pixels are."""
    from endotsr.clips.opencv.filters import area_resize

    side = -(-grey.shape[1] // WIDEST)
    width, height = grey.shape[1] // side, grey.shape[0] // side
    return area_resize(grey, width, height), area_resize(tissue.astype(np.float32), width, height) > 0.999


def _between(before: _Shown, shown: _Shown) -> dict[str, float | str]:
    """`motion` and `cut` between two successive frames."""
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear

    jump = _jump(before, shown)
    if np.count_nonzero(before.mask & shown.mask) < LEAST_PIXELS:
        return {"cut": jump}
    flow = dense_flow(before.grey, shown.grey)
    moved = warp_bilinear(shown.grey.astype(np.float32), flow)
    seen = before.mask & (warp_bilinear(shown.mask.astype(np.float32), flow) > 0.999)
    cut = jump
    if np.count_nonzero(seen) >= LEAST_PIXELS:
        alike = _correlation(before.grey[seen].astype(np.float64), moved[seen].astype(np.float64))
        if alike < LEAST_CORRELATION:
            cut = f"the picture changes (correlation {alike:.2f})"
    motion = float(np.median(np.hypot(*flow)[before.mask])) / before.grey.shape[1]
    return {"cut": cut, "motion": 0.0 if cut else motion}


def _correlation(a: FloatArray, b: FloatArray) -> float:
    """Pearson correlation of two lists of grey levels; 1 if one of them is constant."""
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0 else 1.0


def _jump(before: _Shown, shown: _Shown) -> str:
    """The camera's jump as text; "" if there is none."""
    if before.pose is None or shown.pose is None:
        return ""
    centres = [-pose.rotation.T @ pose.translation for pose in (before.pose, shown.pose)]
    step = float(np.linalg.norm(centres[1] - centres[0]))
    turn = degrees_between(shown.pose.rotation, before.pose.rotation)
    if before.depth is not None and step > LARGEST_STEP * before.depth:
        return f"the camera jumps by {step:.3g} at a depth of {before.depth:.3g}"
    return f"the camera turns by {turn:.1f} degrees" if turn > LARGEST_TURN else ""
