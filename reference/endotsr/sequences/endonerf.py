"""Reading and writing EndoNeRF folders.

    images/*.png     RGB                              poses_bounds.npy (or pose_bounds.npy)   LLFF rows, see poses.py
    depth/*.png      z in millimetres, 0 = none
    masks/*.png      or gt_masks/*.png, white = excluded unless the configuration says otherwise

File names are free, in one pattern a folder; frames are ordered and paired by the number in the name. In: a folder and
the `SequenceConfig`. Out: a `Sequence` in memory, whose notes state every assumption. Input that cannot be used raises
an `InputError` of one line that names file, frame and reason. This module does not depend on models or training.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.opencv import area_resize, read_png, write_png
from endotsr.sequences.files import check_pairing, hash_files, list_pictures, shortened
from endotsr.sequences.masks import (
    check_polarity,
    check_single_masks,
    check_tissue_fraction,
    sparse_step,
    threshold_masks,
)
from endotsr.sequences.poses import cameras_from_rows, find_pose_file, read_pose_rows, rows_from_cameras
from endotsr.sequences.sequence import Sequence
from endotsr.sequences.splits import parse_frame_range, split_frames, time_stamps
from endotsr.splatting.camera import scale_camera
from endotsr.untrusted.files import in_threads

NEAR = 0.2  # near plane of every preset, scene units
LEAST_SIDE = 16  # pixels; the three-level pyramid needs this many
FAR_OFF = 4.0  # times the usual median depth; measured medians of a sequence lie within 1.2
ANOTHER_SCALE = 64.0  # times the usual median depth: 8 bits stretched to 16 make 256
LEAST_DEPTH_FRACTION = 0.05  # of a frame: the median of fewer pixels may be that of a few outliers
UNIT = "mm"


class Folder(NamedTuple):
    """The files of a sequence that a configuration selects, in time order."""

    images: list[Path]
    masks: list[Path]
    depth: list[Path]
    poses: Path
    frames: range  # selected frames, as numbers within the folder
    total: int  # frames in the folder


def select_files(folder: Path, config: SequenceConfig) -> Folder:
    """List, pair and select the files to read.

    Raises:  InputError for a missing folder, a file without its partner, a bad frame range or an impossible split.
    """
    folder = Path(folder)
    if folder.is_file():
        raise InputError(f"{folder}: is a file; allowed: a folder with images/, depth/, {config.masks}/ and poses")
    if not folder.is_dir():
        raise InputError(f"{folder}: sequence folder not found")
    images, masks, depth = (list_pictures(folder / name) for name in ("images", config.masks, "depth"))
    check_pairing(images, masks)
    check_pairing(images, depth)
    try:
        total = len(images)
        frames = parse_frame_range(config.frames, total)
        split_frames(len(frames), config.split, config.block_length)  # an impossible split is refused before reading
    except InputError as error:
        raise InputError(f"{folder}: {error}") from None
    images, masks, depth = ([files[i] for i in frames] for files in (images, masks, depth))
    return Folder(images, masks, depth, find_pose_file(folder), frames, total)


def read_endonerf(folder: Path, config: SequenceConfig, near: float = NEAR) -> Sequence:
    """Read the frames that `config` selects.

    near     near plane, scene units: depth that lies wholly in front of it is refused

    Order of the steps: frame range, split and t = i / n over the selected frames; masks thresholded and turned to
    True = tissue; depth clipped per frame to percentiles of its non-zero values (0 stays 0); then everything is
    scaled by `config.scale`: images by area, a pixel is tissue only if all pixels it covers are, depth is the mean
    of the non-zero values it covers, the camera follows.

    Raises:  InputError (see the module docstring).
    """
    low, high = config.depth_percentiles
    if not 0 <= low < high <= 100:
        raise InputError(f"depth_percentiles: ({low:g}, {high:g}): allowed: two ascending values in [0, 100]")
    files = select_files(folder, config)
    rows = read_pose_rows(files.poses, files.total)
    notes: list[str] = []
    images, white, depth = _read_pictures(files, config, notes)
    masks = ~white if config.excluded_value == "white" else white
    where = str(Path(folder) / config.masks)
    fraction = check_tissue_fraction(masks, where, config.excluded_value, config.allow_tissue_fraction)
    evidence = check_polarity(masks, depth, images, where, config.excluded_value, config.allow_tissue_fraction)
    notes += [
        f"{config.masks}: {config.excluded_value} = excluded; tissue fraction {fraction:.4f}; {evidence}",
        _depth_note(depth, near, files.depth),
    ]
    mask_names = [str(file) for file in files.masks]
    notes += check_single_masks(masks, depth, images, mask_names, config.allow_tissue_fraction)
    height, width = images.shape[2:]
    cameras, static = cameras_from_rows(rows, width, height, files.poses, files.frames)
    if config.scale != 1.0:
        images, masks, depth = _scaled(images, masks, depth, config.scale, str(folder))
        height, width = images.shape[2:]
        scaled = {id(camera): scale_camera(camera, width, height) for camera in cameras}
        cameras = [scaled[id(camera)] for camera in cameras]
        notes.append(f"scaled to {width}x{height}; tissue fraction {masks.mean():.4f}")
        check_tissue_fraction(
            masks, f"{where} at scale {config.scale:g}", config.excluded_value, config.allow_tissue_fraction
        )
    if min(width, height) < LEAST_SIDE:
        raise InputError(f"{folder}: images of {width}x{height} pixels: allowed: at least {LEAST_SIDE} on each side")
    train, test = split_frames(len(images), config.split, config.block_length)
    return Sequence(
        images=images,
        masks=masks,
        depth=depth,
        times=time_stamps(len(images)),
        cameras=cameras,
        names=[file.stem for file in files.images],
        unit=UNIT,
        static_camera=static,
        train_index=train,
        test_index=test,
        notes=notes,
    )


def input_hashes(folder: Path, config: SequenceConfig) -> dict[str, str]:
    """SHA-256 (hex) of every file that `read_endonerf` reads with this configuration, by path inside the folder."""
    files = select_files(folder, config)
    return hash_files(Path(folder), [*files.images, *files.masks, *files.depth, files.poses])


def write_endonerf(sequence: Sequence, folder: Path) -> None:
    """Write a sequence in this layout: images, depth as 16-bit whole millimetres, masks with white = excluded, poses.

    Depth is rounded, to no less than 1 where there is depth. Names become 000000.png, 000001.png, ...
    Raises:  InputError if the folder already holds images, a depth exceeds 65535, or a camera does not fit the format.
    """
    folder = Path(folder)
    if (folder / "images").exists():
        raise InputError(f"{folder}: already holds a sequence (images/)")
    if sequence.depth.max() > 65535:
        frame = int(sequence.depth.reshape(sequence.count, -1).max(axis=1).argmax())
        raise InputError(f"{folder}: frame {frame}: depth {sequence.depth.max():g} does not fit into 16 bits")
    rows = rows_from_cameras(sequence.cameras, sequence.depth.reshape(sequence.count, -1).max(axis=1))
    for name in ("images", "masks", "depth"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    np.save(folder / "poses_bounds.npy", rows)
    for i in range(sequence.count):
        depth = sequence.depth[i]
        millimetres = np.where(depth > 0, np.maximum(np.rint(depth), 1), 0).astype(np.uint16)
        write_png(folder / "images" / f"{i:06d}.png", sequence.images[i].transpose(1, 2, 0))
        write_png(folder / "masks" / f"{i:06d}.png", np.where(sequence.masks[i], 0, 255).astype(np.uint8))
        write_png(folder / "depth" / f"{i:06d}.png", millimetres)


def _read_pictures(
    files: Folder, config: SequenceConfig, notes: list[str]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.float32]]:
    """All selected pictures: images (n, 3, H, W), white mask pixels (n, H, W), clipped depth (n, H, W)."""
    first = read_png(files.images[0])
    height, width = first.shape[:2]
    n = len(files.images)
    images = np.empty((n, 3, height, width), np.uint8)
    depth = np.empty((n, height, width), np.float32)
    masks: list[NDArray] = [first] * n
    depth_types = [first.dtype] * n

    def read_frame(i: int) -> None:
        images[i] = _read_colour(files.images[i], width, height)
        masks[i] = _read_grey(files.masks[i], width, height)
        raw = _read_grey(files.depth[i], width, height)
        depth_types[i] = raw.dtype
        depth[i] = clip_depth(raw, config.depth_percentiles)

    in_threads(read_frame, n)
    _check_depth_scale(depth, files.depth, depth_types)
    return images, threshold_masks(masks, [str(file) for file in files.masks], notes), depth


def clip_depth(depth: NDArray, percentiles: tuple[float, float]) -> NDArray[np.float32]:
    """Depth clipped to two percentiles of its non-zero values; 0 (no depth) stays 0. (H, W) to (H, W) float32."""
    result = depth.astype(np.float32)
    valid = result > 0
    if valid.any():
        low, high = np.percentile(result[valid], percentiles)
        result[valid] = np.clip(result[valid], low, high)
    return result


def _read_colour(path: Path, width: int, height: int) -> NDArray[np.uint8]:
    pixels = _read_sized(path, width, height)
    if pixels.dtype != np.uint8:
        raise InputError(f"{path}: 16-bit picture; images must have 8 bits a channel")
    if pixels.ndim == 2:
        raise InputError(f"{path}: grey picture; images must be RGB")
    return pixels.transpose(2, 0, 1)


def _read_grey(path: Path, width: int, height: int) -> NDArray:
    pixels = _read_sized(path, width, height)
    if pixels.ndim == 3:
        if (pixels != pixels[:, :, :1]).any():
            raise InputError(f"{path}: coloured picture; one grey channel expected")
        pixels = np.ascontiguousarray(pixels[:, :, 0])
    return pixels


def _read_sized(path: Path, width: int, height: int) -> NDArray:
    pixels = read_png(path)
    if pixels.shape[:2] != (height, width):
        raise InputError(f"{path}: {pixels.shape[1]}x{pixels.shape[0]} pixels, the first image has {width}x{height}")
    return pixels


def _depth_note(depth: NDArray[np.float32], near: float, files: list[Path]) -> str:
    """The note on the prior depth. Raises InputError for a sequence without any."""
    valid = depth > 0
    where = files[0].parent
    if not valid.any():
        raise InputError(f"{where}: no pixel of the {len(depth)} frames has a depth")
    values = depth[valid]
    if values.max() <= near:
        raise InputError(f"{where}: the largest depth is {values.max():g}, in front of the near plane at {near:g}")
    empty = np.flatnonzero(~valid.any(axis=(1, 2)))
    behind = float((values <= near).mean())
    far_off = [f"{files[i].name} ({ratio:.3g} times)" for i, ratio in _far_off(depth, FAR_OFF)]
    return (
        f"depth in {UNIT}, {values.min():g} to {values.max():g} after clipping;"
        f" missing on {1 - valid.mean():.4f} of the pixels"
        + (f"; frames without any: {', '.join(map(str, empty))}" if empty.size else "")
        + (f"; {behind:.1%} of it lies in front of the near plane at {near:g}" if behind else "")
        + (f"; far from the usual median, perhaps in another unit: {shortened(far_off)}" if far_off else "")
    )


def _check_depth_scale(depth: NDArray[np.float32], files: list[Path], types: list[np.dtype]) -> None:
    """Refuse a depth picture that is scaled to 16 bits while others hold millimetres in 8 bits.

    Mixed bit depths alone are legal and occur in published sequences: one far value makes a picture 16-bit.
    """
    for i, ratio in _far_off(depth, ANOTHER_SCALE) if len(set(types)) > 1 else []:
        if np.count_nonzero(depth[i]) >= LEAST_DEPTH_FRACTION * depth[i].size:
            bits = 8 * types[i].itemsize
            other = next(j for j, kind in enumerate(types) if kind != types[i])
            raise InputError(
                f"{files[i]}: {bits}-bit picture, its median depth is {ratio:.3g} times the usual one, while"
                f" {files[other].name} has {8 * types[other].itemsize} bits; allowed: {UNIT} in every picture"
            )


def _far_off(depth: NDArray[np.float32], factor: float) -> list[tuple[int, float]]:
    """Frames whose median depth is over `factor` times the usual one, or under 1 / `factor`; with that ratio."""
    step = sparse_step(depth.shape[1])
    sparse = depth[:, ::step, ::step]
    medians = {i: float(np.median(frame[frame > 0])) for i, frame in enumerate(sparse) if (frame > 0).any()}
    usual = float(np.median(list(medians.values()) or [1.0]))
    ratios = [(i, median / usual) for i, median in medians.items()]
    return [(i, ratio) for i, ratio in ratios if not 1 / factor <= ratio <= factor]


def _scaled(
    images: NDArray[np.uint8], masks: NDArray[np.bool_], depth: NDArray[np.float32], scale: float, where: str
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.float32]]:
    if scale > 1:
        raise InputError(f"{where}: scale {scale:g}: images are only reduced; allowed: values in (0, 1]")
    n, _, old_height, old_width = images.shape
    width, height = round(old_width * scale), round(old_height * scale)
    if min(width, height) < LEAST_SIDE:
        raise InputError(
            f"{where}: scale {scale:g} makes {width}x{height} pixels of {old_width}x{old_height};"
            f" allowed: at least {LEAST_SIDE} on each side"
        )
    small = np.empty((n, 3, height, width), np.uint8)
    tissue = np.empty((n, height, width), bool)
    prior = np.zeros((n, height, width), np.float32)
    for i in range(n):
        small[i] = area_resize(images[i].transpose(1, 2, 0), width, height).transpose(2, 0, 1)
        tissue[i] = area_resize((~masks[i]).astype(np.float32), width, height) == 0
        fraction = area_resize((depth[i] > 0).astype(np.float32), width, height)
        np.divide(area_resize(depth[i], width, height), fraction, out=prior[i], where=fraction > 0)
    return small, tissue, prior
