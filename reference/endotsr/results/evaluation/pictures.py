"""Evaluation of a folder of pictures or a video: the renders of any method, measured by the same code.

In: a folder with one picture per frame, `.png`, `.tiff`, `.bmp` (8 or 16 bit) or `.npy` (float), or a video, and the
sequence that they show. Out: the file of every frame, and the dictionary of metrics.json. A baseline saved as `.npy`
reproduces its metrics to the last digit; an 8-bit file rounds. Compression losses of a video count as errors of its
method.
"""

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import frame_numbers, shortened, visible_files
from endotsr.clips.formats.video_file import is_video, video_facts, video_pictures
from endotsr.clips.opencv import pictures as stored
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array, FloatArray
from endotsr.method.kernels.memory import Kept
from endotsr.results.evaluation.doubts import doubt
from endotsr.results.evaluation.evaluate import evaluate_model
from endotsr.results.evaluation.lpips import LpipsWeights
from endotsr.results.evaluation.records import PicturesEvaluation
from endotsr.training.runs.sources import digest
from endotsr.untrusted.arrays import read_npy

KINDS = (".npy", ".png", *stored.TIFF_ENDINGS, ".bmp")  # lossless; the first kind found in a folder is read
CHANNELS = 3
LARGEST_FILE = 1 << 32  # bytes
KEPT_BYTES = 1 << 28  # of the last pictures in memory; others are read again for the metrics
LARGEST = 16.0  # display units; a larger value means 8-bit or 16-bit levels, not an overshoot
LOWEST = -0.5  # display units; a lower value means pictures from -1 to 1, not an undershoot


class Pictures(NamedTuple):
    """The pictures of a folder or video by frame number, and how they were paired with the frames."""

    folder: Path  # or the video
    files: dict[int, Path]  # frame number -> file (VIDEO/NUMBER for a video), at least for the held-out frames
    pairing: str  # as text
    decoded: dict[int, NDArray[np.uint8]] | None = None  # of a video: frame number -> (H, W, 3)

    def read(self, index: int, shape: tuple[int, ...]) -> FloatArray:
        """The picture of a frame in display units, (3, H, W). Raises InputError as `read_render`."""
        if self.decoded is None:
            return read_render(self.files[index], shape)
        levels = self.decoded[index]
        return _of_shape(levels.astype(np.float32) / np.float32(255), shape, self.files[index])


def find_renders(folder: Path, sequence: Sequence) -> Pictures:
    """Pair the held-out frames with the pictures of a folder or a video.

    The first of these rules with one file for every held-out frame applies: the name of the frame (the stem, or the
    stem up to its first dot); the frame number in the name, counted from 0; the order of the numbers, if there are as
    many files as held-out frames, or as many as frames. For a video only the order applies.

    Raises: InputError for a clip, for a folder without pictures, if no rule applies, or for an unreadable video.
    """
    folder = Path(folder)
    if is_video(folder):
        return _of_video(folder, sequence)
    _refuse_clip(folder)
    files = _listed(folder)
    held_out = [int(i) for i in sequence.test_index]
    numbers = frame_numbers(files)
    for found, pairing in (
        (_by_name(files, sequence), "by the names of the frames"),
        (_by_number(files, numbers, sequence.count), "by the frame numbers in the names"),
        (_by_order(files, numbers, held_out), "in order: as many files as held-out frames"),
        (_by_order(files, numbers, list(range(sequence.count))), "in order: as many files as frames"),
    ):
        if all(i in found for i in held_out):
            return Pictures(folder, {i: found[i] for i in sorted(found) if i < sequence.count}, pairing)
    wanted = shortened([sequence.names[i] for i in held_out])
    raise InputError(
        f"{folder}: {len(files)} {files[0].suffix} files cannot be paired with the {len(held_out)} held-out frames "
        f"({wanted}); use their names, their numbers, or one file for each, numbered in order"
    )


def _refuse_clip(folder: Path) -> None:
    """Raises InputError for a folder that is trained on: its pictures are what methods predict."""
    from endotsr.clips.sequences.layouts import layouts

    if any(layout.direct and layout.recognises(folder) for layout in layouts()):
        raise InputError(
            f"{folder}: a clip, not a method; `endotsr evaluate RUN` measures a run on its own clip, and --sequence"
            " names the clip of a folder of pictures"
        )


def _of_video(path: Path, sequence: Sequence) -> Pictures:
    facts, held_out = video_facts(path), [int(i) for i in sequence.test_index]
    for frames, pairing in (
        (list(range(sequence.count)), "in order: as many pictures as frames"),
        (held_out, "in order: as many pictures as held-out frames"),
    ):
        if facts.count == len(frames):
            pictures = video_pictures(path, list(range(facts.count)))
            decoded = {i: np.rot90(picture, facts.turn // 90) for i, picture in zip(frames, pictures, strict=True)}
            return Pictures(path, {i: path / str(k) for k, i in enumerate(frames)}, pairing, decoded)
    raise InputError(
        f"{path}: a video of {facts.count} pictures; use one for each of the {sequence.count} frames or of the"
        f" {len(held_out)} held-out ones, in order"
    )


def _listed(folder: Path) -> list[Path]:
    """The pictures of a folder by name, all of one kind."""
    if not folder.is_dir():
        raise InputError(f"{folder}: folder of pictures, or video, not found")
    for kind in KINDS:
        files = [file for file in visible_files(folder) if file.suffix.lower() == kind]
        if files:
            return files
    raise InputError(f"{folder}: contains no picture; use one file per frame, {', '.join(KINDS)}")


def _by_name(files: list[Path], sequence: Sequence) -> dict[int, Path]:
    """Pair frames and files with equal names, or equal names up to the first dot if one frame and one file have it."""
    whole = {file.stem: file for file in files}
    short: dict[str, list[Path]] = {}
    for file in files:
        short.setdefault(file.name.split(".")[0], []).append(file)
    shared = Counter(name.split(".")[0] for name in sequence.names)  # by names of seconds: all frames of one second
    found = {}
    for i, name in enumerate(sequence.names):
        first = name.split(".")[0]
        alike = short.get(first, [])
        if name in whole:
            found[i] = whole[name]
        elif len(alike) == shared[first] == 1:
            found[i] = alike[0]
    return found


def _by_number(files: list[Path], numbers: list[tuple[int, ...]] | None, count: int) -> dict[int, Path]:
    """The files by the number in their names, that of a frame counted from 0.

    {} if a name has not exactly one number, if a number repeats, or if there are as many files as frames with other
    numbers, such as those of files counted from 1.
    """
    if numbers is None or len(numbers[0]) != 1 or len(set(numbers)) < len(numbers):
        return {}
    found = {number: file for (number,), file in zip(numbers, files)}
    return {} if len(files) == count and found.keys() != set(range(count)) else found


def _by_order(files: list[Path], numbers: list[tuple[int, ...]] | None, frames: list[int]) -> dict[int, Path]:
    """One file per frame in the order of the numbers; {} if the counts differ."""
    if len(files) != len(frames) or (numbers is None and len(files) > 1):
        return {}
    ordered = files if numbers is None else [file for _, file in sorted(zip(numbers, files))]
    return dict(zip(frames, ordered))


def read_render(file: Path, shape: tuple[int, ...]) -> FloatArray:
    """One picture in display units.

    file      PNG, TIFF or BMP: 8 or 16 bits, divided by 255 or 65535; NPY: floats in display units, (3, H, W) or
              (H, W, 3)
    shape     (3, H, W) of the frame
    returns   (3, H, W), float32, or float64 for a float64 file; not clipped

    Raises: InputError naming the file: unreadable, wrong shape or type, values that are no display units.
    """
    return _of_shape(_read_array(file) if file.suffix.lower() == ".npy" else _read_levels(file), shape, file)


def _of_shape(picture: Array, shape: tuple[int, ...], file: Path) -> FloatArray:
    """The picture as (3, H, W). Raises InputError for another size."""
    if picture.ndim == len(shape) and picture.shape != shape and picture.shape[2:] == (CHANNELS,):
        picture = picture.transpose(2, 0, 1)
    if picture.shape != shape:
        size = "x".join(map(str, picture.shape))
        is_picture = picture.ndim == len(shape) and picture.shape[0] == CHANNELS
        found = f"a picture of {picture.shape[2]}x{picture.shape[1]}" if is_picture else f"an array of {size}"
        raise InputError(f"{file}: {found}; use a picture of {shape[2]}x{shape[1]} in 3 channels")
    return np.ascontiguousarray(picture)


def _read_levels(file: Path) -> FloatArray:
    pixels = stored.read_picture(file)
    if pixels.dtype.kind != "u":
        raise InputError(f"{file}: type {pixels.dtype}; use levels of 8 or 16 bits, or .npy")
    if pixels.dtype == np.uint16 and pixels.any() and pixels.max() <= np.iinfo(np.uint8).max:
        raise InputError(
            f"{file}: 16 bits whose largest value is {pixels.max()}: levels of 8 bits, which would be divided by 65535;"
            " use levels of 8 bits stored as such, or of 16 bits up to 65535"
        )
    return pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)


def _read_array(file: Path) -> Array:
    array = read_npy(file, LARGEST_FILE)
    if array.dtype not in (np.float32, np.float64):
        kinds = "an array of float32 or float64 in display units [0, 1]"
        raise InputError(f"{file}: type {array.dtype}; use {kinds}")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: values that are not finite; use display units [0, 1]")
    if array.size and np.abs(array).max() > LARGEST:
        raise InputError(f"{file}: value {np.abs(array).max():g}; use display units, from 0 to 1 (not to 255)")
    if array.size and array.min() < LOWEST:
        raise InputError(f"{file}: value {array.min():g}; use display units, from 0 to 1 (not from -1)")
    return array


def measure_pictures(
    pictures: Pictures, sequence: Sequence, label: str = "", weights: LpipsWeights | None = None
) -> PicturesEvaluation:
    """The dictionary of metrics.json for a folder of pictures.

    label     name of the method; default: the name of the folder
    returns   the keys of `evaluate_model`, `label`, and `pictures` (folder, pairing, `doubt`, digests, file of every
              frame). The training part covers the training frames with a picture, possibly none

    Raises: InputError as `read_render`.
    """
    shape = sequence.images.shape[1:]
    training = [int(i) for i in sequence.train_index if int(i) in pictures.files]
    kept: Kept[int, FloatArray] = Kept(KEPT_BYTES)

    def read(index: int) -> FloatArray:
        return kept.get(index, lambda: pictures.read(index, shape))

    said = doubt(sequence, read)
    metrics = evaluate_model(sequence, read, weights, training)
    metrics["label"] = label or pictures.folder.absolute().name
    return {
        **metrics,
        "pictures": {
            "folder": str(pictures.folder.absolute()),
            "pairing": pictures.pairing,
            "doubt": said,
            "arrays_sha256": {name: digest(getattr(sequence, name)) for name in ("images", "masks")},
            "files": {sequence.names[i]: file.name for i, file in pictures.files.items()},
        },
    }
