"""From frames in memory to a checked `Sequence`: what is the same for every layout.

Comes in: pictures, tissue masks or none, prior depth, cameras, and names for messages. Goes out: a `Sequence` whose
notes state every assumption, or an `InputError`. The order of the steps: tissue fraction and polarity, depth, scaling,
split, world.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.opencv import area_resize
from endotsr.sequences.checks.depth import DepthFacts
from endotsr.sequences.checks.frames import FrameFacts
from endotsr.sequences.checks.guard import guarded, with_coverage
from endotsr.sequences.depth_files import reduced_depth
from endotsr.sequences.files import shortened
from endotsr.sequences.frame_store import FrameStore
from endotsr.sequences.masks import check_polarity, check_single_masks, check_tissue_fraction, sparse_step
from endotsr.sequences.sequence import Sequence
from endotsr.sequences.splits import frame_times, split_frames
from endotsr.sequences.world import fitting_world, moved_cameras, world_note
from endotsr.splatting.camera import Camera, camera_centre, scale_camera

LEAST_SIDE = 16  # pixels; the three-level pyramid needs this many
FAR_OFF = 4.0  # times the usual median depth; measured medians of a sequence lie within 1.2
ANOTHER_SCALE = 64.0  # times the usual median depth: 8 bits stretched to 16 make 256
LEAST_DEPTH_FRACTION = 0.05  # of a frame: the median of fewer pixels may be that of a few outliers
NO_MASKS = "no masks: every pixel counts as tissue, instruments included"


class MaskSource(NamedTuple):
    """Where the masks come from and what they say, for checks and messages."""

    folder: str  # path
    names: list[str]  # n paths
    excluded_value: str  # white or black
    stated_in: str = ""  # the file that states it; "": the settings do


class Frames(NamedTuple):
    """All frames of a sequence, before checks and scaling."""

    images: NDArray[np.uint8]  # (n, 3, H, W)
    masks: NDArray[np.bool_]  # (n, H, W) True = tissue
    depth: NDArray[np.float32]  # (n, H, W) in `unit`, clipped; 0 = none
    cameras: list[Camera]
    static: bool
    image_files: list[Path]  # n
    depth_files: list[Path]  # n, for messages
    facts: tuple[list[FrameFacts], list[DepthFacts]]  # n of each: what the checks need of pictures and stored depth
    store: FrameStore  # of the arrays
    unit: str
    mask_source: MaskSource | None  # None: there are no masks
    arbitrary: bool = False  # the unit is unknown: the scale of the world is free
    seconds: NDArray[np.float64] | None = None  # (n,) of the frames, ascending; None: evenly spaced


def assemble(frames: Frames, config: SequenceConfig, near: float, folder: Path, notes: list[str]) -> Sequence:
    """The checked, scaled and split sequence.

    near     near plane, scene units: depth that lies wholly in front of it is refused
    notes    sentences so far; the sequence has them first

    Raises:  InputError (see the module docstring).
    """
    images, masks, depth, cameras = frames.images, frames.masks, frames.depth, frames.cameras
    world = fitting_world(np.array([camera_centre(camera) for camera in cameras]), depth, frames.arbitrary)
    if not world.unchanged:
        cameras = moved_cameras(cameras, world)
        if world.scale != 1.0:
            np.multiply(depth, np.float32(world.scale), out=depth)
        notes.append(world_note(world, frames.unit))
    notes += _mask_notes(frames, config)
    notes.append(_depth_note(depth, near, frames.depth_files, "scene units" if frames.arbitrary else frames.unit))
    notes += _guarded(frames, near)
    if frames.store.note:
        notes.append(frames.store.note)
    if frames.mask_source:
        notes += check_single_masks(masks, depth, images, frames.mask_source.names, config.allow_tissue_fraction)
    height, width = images.shape[2:]
    if config.scale != 1.0:
        images, masks, depth = _scaled(images, masks, depth, config, str(folder))
        height, width = images.shape[2:]
        scaled = {id(camera): scale_camera(camera, width, height) for camera in cameras}
        cameras = [scaled[id(camera)] for camera in cameras]
        notes.append(f"scaled to {width}x{height}; tissue fraction {masks.mean():.4f}")
        _check_scaled_fraction(frames.mask_source, masks, config)
    if min(width, height) < LEAST_SIDE:
        raise InputError(f"{folder}: images of {width}x{height} pixels: allowed: at least {LEAST_SIDE} on each side")
    train, test = split_frames(len(images), config.split, config.block_length)
    return Sequence(
        images=images,
        masks=masks,
        depth=depth,
        times=frame_times(frames.seconds, len(images)),
        cameras=cameras,
        names=[file.stem for file in frames.image_files],
        unit=frames.unit,
        static_camera=frames.static,
        train_index=train,
        test_index=test,
        notes=notes,
    )


def _guarded(frames: Frames, near: float) -> list[str]:
    """Notes of the checks that `endotsr check` makes too. Raises InputError for what it refuses."""
    pictures, depth = frames.facts
    facts = pictures, with_coverage(depth, frames.depth, frames.masks)
    where = frames.depth_files[0].parent
    return guarded(frames.image_files, facts, frames.cameras, where, frames.arbitrary, near, frames.seconds)


def check_percentiles(config: SequenceConfig) -> None:
    """Raises InputError for percentiles of the depth that are not ascending values in [0, 100]."""
    low, high = config.depth_percentiles
    if not 0 <= low < high <= 100:
        raise InputError(f"depth_percentiles: ({low:g}, {high:g}): allowed: two ascending values in [0, 100]")


def check_depth_scale(depth: NDArray[np.float32], files: list[Path], types: list[np.dtype], unit: str) -> None:
    """Refuse a depth picture that is scaled to 16 bits while others hold lengths in 8 bits.

    Mixed bit depths alone are legal and occur in published sequences: one far value makes a picture 16-bit.
    """
    for i, ratio in far_off(depth, ANOTHER_SCALE) if len(set(types)) > 1 else []:
        if np.count_nonzero(depth[i]) >= LEAST_DEPTH_FRACTION * depth[i].size:
            bits = 8 * types[i].itemsize
            other = next(j for j, kind in enumerate(types) if kind != types[i])
            raise InputError(
                f"{files[i]}: {bits}-bit picture, its median depth is {ratio:.3g} times the usual one, while"
                f" {files[other].name} has {8 * types[other].itemsize} bits; allowed: {unit} in every picture"
            )


def far_off(depth: NDArray[np.float32], factor: float) -> list[tuple[int, float]]:
    """Frames whose median depth is over `factor` times the usual one, or under 1 / `factor`; with that ratio."""
    step = sparse_step(depth.shape[1])
    sparse = depth[:, ::step, ::step]
    medians = {i: float(np.median(frame[frame > 0])) for i, frame in enumerate(sparse) if (frame > 0).any()}
    usual = float(np.median(list(medians.values()) or [1.0]))
    ratios = [(i, median / usual) for i, median in medians.items()]
    return [(i, ratio) for i, ratio in ratios if not 1 / factor <= ratio <= factor]


def _mask_notes(frames: Frames, config: SequenceConfig) -> list[str]:
    """The note on the masks: polarity, tissue fraction, evidence. Raises InputError for masks that look inverted."""
    if frames.mask_source is None:
        return [NO_MASKS]
    where, _, excluded, stated_in = frames.mask_source
    allow = config.allow_tissue_fraction
    fraction = check_tissue_fraction(frames.masks, where, excluded, allow)
    evidence = check_polarity(frames.masks, frames.depth, frames.images, where, excluded, allow, stated_in)
    return [f"{Path(where).name}: {excluded} = excluded; tissue fraction {fraction:.4f}; {evidence}"]


def _check_scaled_fraction(source: MaskSource | None, masks: NDArray[np.bool_], config: SequenceConfig) -> None:
    if source:
        where = f"{source.folder} at scale {config.scale:g}"
        check_tissue_fraction(masks, where, source.excluded_value, config.allow_tissue_fraction)


def _depth_note(depth: NDArray[np.float32], near: float, files: list[Path], unit: str) -> str:
    """The note on the prior depth. Raises InputError for a sequence without any."""
    where = files[0].parent
    rows = [_extent(plane, near) for plane in depth]  # frame by frame: no array over all frames is made
    known, before = sum(row.known for row in rows), sum(row.before for row in rows)
    if not known:
        raise InputError(f"{where}: no pixel of the {len(depth)} frames has a depth")
    nearest, farthest = min(row.nearest for row in rows), max(row.farthest for row in rows)
    if farthest <= near:
        raise InputError(f"{where}: the largest depth is {farthest:g}, in front of the near plane at {near:g}")
    empty = [i for i, row in enumerate(rows) if not row.known]
    behind = before / known
    distant = [f"{files[i].name} ({ratio:.3g} times)" for i, ratio in far_off(depth, FAR_OFF)]
    return (
        f"depth in {unit}, {nearest:g} to {farthest:g} after clipping;"
        f" missing on {1 - known / depth.size:.4f} of the pixels"
        + (f"; frames without any: {', '.join(map(str, empty))}" if empty else "")
        + (f"; {behind:.1%} of it lies in front of the near plane at {near:g}" if behind else "")
        + (f"; far from the usual median, perhaps in another unit: {shortened(distant)}" if distant else "")
    )


class _Extent(NamedTuple):
    """The prior depth of a frame in numbers."""

    known: int  # pixels with depth
    before: int  # of them, up to the near plane
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
        raise InputError(f"{where}: scale {scale:g}: images are only reduced; allowed: values in (0, 1]")
    n, _, old_height, old_width = images.shape
    width, height = round(old_width * scale), round(old_height * scale)
    if min(width, height) < LEAST_SIDE:
        raise InputError(
            f"{where}: scale {scale:g} makes {width}x{height} pixels of {old_width}x{old_height};"
            f" allowed: at least {LEAST_SIDE} on each side"
        )
    store = FrameStore(n, width, height, config.memory, where)
    small, tissue = store.array((n, 3, height, width), np.uint8), store.array((n, height, width), bool)
    prior = store.array((n, height, width), np.float32)
    for i in range(n):
        small[i] = area_resize(images[i].transpose(1, 2, 0), width, height).transpose(2, 0, 1)
        tissue[i] = area_resize((~masks[i]).astype(np.float32), width, height) == 0
        prior[i] = reduced_depth(depth[i], width, height)
    return small, tissue, prior
