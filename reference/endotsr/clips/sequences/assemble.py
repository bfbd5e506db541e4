"""From the files of the frames to a checked `Sequence`: the steps common to all layouts.

In: the selected files and the cameras. Out: a `Sequence` whose notes state every assumption, or an `InputError`. The
steps, in order: reading, world, tissue fraction and polarity, depth, scaling, split.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.guard import guarded
from endotsr.clips.sequences.masks import check_polarity, check_single_masks, check_tissue_fraction
from endotsr.clips.sequences.read_frames import FrameFiles, Frames, read_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.smaller import smaller_cameras, smaller_frames
from endotsr.clips.sequences.splits import frame_times, split_frames
from endotsr.clips.sequences.world import fitting_world, moved_cameras, world_note
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, camera_centre

LEAST_SIDE = 16  # pixels; the three-level pyramid needs this many
NO_MASKS = "no masks: every pixel counts as tissue, instruments included"


def assemble(
    files: FrameFiles, cameras: list[Camera], config: SequenceConfig, near: float, folder: Path, notes: list[str]
) -> Sequence:
    """Read, check, scale and split the frames.

    cameras  one per frame; the same object for all frames of a static camera
    near     near plane, scene units; a sequence whose depth is entirely in front of it is refused
    notes    existing notes; new ones are appended

    Raises:  InputError (see the module docstring).
    """
    frames = read_frames(files, config, folder, notes)
    images, masks, depth, static = frames.images, frames.masks, frames.depth, cameras[0] is cameras[-1]
    world = fitting_world(np.array([camera_centre(camera) for camera in cameras]), depth, files.arbitrary)
    if not world.unchanged:
        cameras = moved_cameras(cameras, world)
        if world.scale != 1.0:
            np.multiply(depth, np.float32(world.scale), out=depth)
        notes.append(world_note(world, files.unit))
    notes += _mask_notes(frames, files, config)
    notes.append(_depth_note(depth, near, files.depth, "scene units" if files.arbitrary else files.unit))
    notes += guarded(files, frames, cameras, near)
    notes += [frames.store.note] if frames.store.note else []
    if files.masks:
        notes += check_single_masks(masks, depth, images, list(map(str, files.masks)), config.allow_tissue_fraction)
    height, width = images.shape[2:]
    if config.scale != 1.0:
        images, masks, depth = _scaled(images, masks, depth, config, str(folder))
        height, width = images.shape[2:]
        cameras = smaller_cameras(cameras, width, height)
        notes.append(f"scaled to {width}x{height}; tissue fraction {masks.mean():.4f}")
        if files.masks:
            at_scale = f"{files.masks[0].parent} at scale {config.scale:g}"
            check_tissue_fraction(masks, at_scale, files.excluded_value, config.allow_tissue_fraction)
    if min(width, height) < LEAST_SIDE:
        raise InputError(f"{folder}: images of {width}x{height} pixels: allowed: at least {LEAST_SIDE} on each side")
    train, test = split_frames(len(images), config.split, config.block_length)
    return Sequence(
        images=images,
        masks=masks,
        depth=depth,
        times=frame_times(files.seconds, len(images)),
        cameras=cameras,
        names=[file.stem for file in files.images],
        unit=files.unit,
        static_camera=static,
        train_index=train,
        test_index=test,
        notes=notes,
        duration=files.duration,
    )


def check_percentiles(config: SequenceConfig) -> None:
    """Raises InputError unless the depth percentiles are two ascending values in [0, 100]."""
    low, high = config.depth_percentiles
    if not 0 <= low < high <= 100:
        raise InputError(f"depth_percentiles: ({low:g}, {high:g}): allowed: two ascending values in [0, 100]")


def _mask_notes(frames: Frames, files: FrameFiles, config: SequenceConfig) -> list[str]:
    """The note on the masks: polarity, tissue fraction, evidence. Raises InputError for masks that seem inverted."""
    if not files.masks:
        return [NO_MASKS]
    where, excluded, allow = files.masks[0].parent, files.excluded_value, config.allow_tissue_fraction
    fraction = check_tissue_fraction(frames.masks, str(where), excluded, allow)
    evidence = check_polarity(frames.masks, frames.depth, frames.images, str(where), excluded, allow, files.stated_in)
    return [f"{where.name}: {excluded} = excluded; tissue fraction {fraction:.4f}; {evidence}"]


def _depth_note(depth: NDArray[np.float32], near: float, files: list[Path], unit: str) -> str:
    """The note on the prior depth. Raises InputError for a sequence without depth."""
    where = files[0].parent
    rows = [_extent(plane, near) for plane in depth]  # frame by frame, without an array over all frames
    known, before = sum(row.known for row in rows), sum(row.before for row in rows)
    if not known:
        raise InputError(f"{where}: no pixel of the {len(depth)} frames has a depth")
    nearest, farthest = min(row.nearest for row in rows), max(row.farthest for row in rows)
    if farthest <= near:
        raise InputError(f"{where}: the largest depth is {farthest:g}, in front of the near plane at {near:g}")
    empty = [i for i, row in enumerate(rows) if not row.known]
    behind = before / known
    return (
        f"depth in {unit}, {nearest:g} to {farthest:g} after clipping;"
        f" missing on {1 - known / depth.size:.4f} of the pixels"
        + (f"; frames without any: {', '.join(map(str, empty))}" if empty else "")
        + (f"; {behind:.1%} of it is in front of the near plane at {near:g}" if behind else "")
    )


class _Extent(NamedTuple):
    """Statistics of the prior depth of a frame."""

    known: int  # pixels with depth
    before: int  # pixels with depth up to the near plane
    nearest: np.floating
    farthest: np.floating


def _extent(plane: NDArray[np.float32], near: float) -> _Extent:
    values = plane[plane > 0]
    if not values.size:
        return _Extent(0, 0, np.float32(np.inf), np.float32(0))
    return _Extent(values.size, int(np.count_nonzero(values <= near)), values.min(), values.max())


def _scaled(
    images: NDArray[np.uint8], masks: NDArray[np.bool_], depth: NDArray[np.float32], config: SequenceConfig, where: str
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.float32]]:
    scale = config.scale
    if scale > 1:
        raise InputError(f"{where}: scale {scale:g}: images can only be reduced; allowed: values in (0, 1]")
    old_height, old_width = images.shape[2:]
    width, height = round(old_width * scale), round(old_height * scale)
    if min(width, height) < LEAST_SIDE:
        raise InputError(
            f"{where}: scale {scale:g} makes {width}x{height} pixels of {old_width}x{old_height};"
            f" allowed: at least {LEAST_SIDE} on each side"
        )
    return smaller_frames(images, masks, depth, width, height, config.memory, where)
