"""The slim model: a trained scene for rendering, in one compressed file of half precision.

Unlike a checkpoint, it has no optimiser state, and all arrays except the positions are rounded to float16. Positions
keep float32, because rounding them would move the picture. Arrays and cameras are in world coordinates of the training;
`placement` transforms them to the axes of the other exports. The file is an npz without pickle: a JSON header (as
bytes) with settings, iteration and the record of the sequence, and one entry per array.
"""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.record import SequenceRecord, checked_record, recorded
from endotsr.config import ModelConfig, config_from_dict
from endotsr.errors import InputError
from endotsr.training.fitting.model import corrected_cameras, spectral_from
from endotsr.training.runs.model import Model
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS, Gaussians, arrays
from endotsr.training.scene.parameters import FrameParameters, pose_at, trained
from endotsr.untrusted.arrays import RefusedArray, open_npz
from endotsr.untrusted.json import integer, listed, number, parsed
from endotsr.untrusted.marks import SLIM
from endotsr.untrusted.writing import replace_file

VERSION = 1
HEADER = "header"
LARGEST_FILE = 1 << 33  # bytes, sum over all arrays
KEPT_WHOLE = ("gaussians.position",)  # stored as float32
HALF = np.finfo(np.float16)
WHOLE = "use a file as `endotsr export RUN --out FILE.npz` writes it"


class SlimModel(NamedTuple):
    """A model and the record of its sequence (sequence.json)."""

    model: Model
    record: SequenceRecord


def save_slim_model(path: Path, model: Model, record: SequenceRecord) -> None:
    """Write a slim model atomically. Equal models give equal bytes.

    record   sequence.json
    Edges:   values beyond the range of float16 (65504) are clipped.
    """
    exposures = _exposures(model.frames)
    header = {
        "format": SLIM,
        "version": VERSION,
        "iteration": model.iteration,
        "config": msgspec.to_builtins(model.config),
        "sequence": msgspec.to_builtins(_with_corrected_cameras(record, model)),
        "frame_times": None if exposures is None else exposures.times.tolist(),
    }
    entries = {f"gaussians.{name}": a for name, a in arrays(model.gaussians).items()}
    entries |= {f"frames.{name}": a for name, a in trained(exposures).items()}
    stored = {
        name: a.astype(np.float32) if name in KEPT_WHOLE else np.clip(a, HALF.min, HALF.max).astype(np.float16)
        for name, a in entries.items()
    }
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **{HEADER: text}, **stored)

    replace_file(path, write)


def load_slim_model(path: Path) -> SlimModel:
    """Read and check a slim model; returns float32 arrays.

    Raises: InputError naming the file and the key: not a slim model, another version, an array that is missing,
            unknown, of the wrong shape or not finite, unknown settings, damaged data.
    """
    path = Path(path)
    try:
        with open_npz(path, LARGEST_FILE, compressed=True) as file:
            entries = {name: file.read(name) for name in file.names}
        header = parsed(entries.pop(HEADER).tobytes(), f"{path}: header")
    except (RefusedArray, KeyError) as error:
        raise InputError(f"{path}: not a slim model, or damaged: {error}") from None
    if not isinstance(header, dict) or (header.get("format"), header.get("version")) != (SLIM, VERSION):
        raise InputError(
            f"{path}: not a slim model of version {VERSION}; `endotsr export RUN --out FILE.npz` writes one"
        )
    for key in ("iteration", "config", "sequence", "frame_times"):
        if key not in header:
            raise InputError(f"{path}: header: {key} is missing; {WHOLE}")
    record = checked_record(header["sequence"], f"{path}: header", "sequence.")
    config = config_from_dict(header["config"], str(path))
    gaussians = _gaussians(entries, path)
    _refuse_other_settings(gaussians, config.model, path)
    frames = _frames(entries, header["frame_times"], path)
    if entries:
        raise InputError(f"{path}: {next(iter(entries))} is not an entry of a slim model")
    spectral = spectral_from(config.model, record.train_times)
    iteration = integer(header["iteration"], f"{path}: header: iteration", low=0)
    return SlimModel(Model(gaussians, spectral, config, iteration, frames), record)


def _gaussians(entries: dict[str, NDArray], path: Path) -> Gaussians:
    """The checked arrays of the Gaussians, removed from `entries`."""
    found = {name: _entry(entries, f"gaussians.{name}", path) for name in Gaussians._fields}
    needed = Gaussians._fields[: len(Gaussians._fields) - len(Gaussians._field_defaults)]
    for name in needed:
        if found[name] is None:
            raise InputError(f"{path}: gaussians.{name} is missing; {WHOLE}")
    count = found["position"].shape[-1]
    rows = {"position": (3,), "quaternion": (4,), "log_scale": (3,), "opacity_logit": ()}
    for name, array in found.items():
        shape = array if array is None else array.shape
        if shape is not None and (shape[-1:] != (count,) or shape[:-1] != rows.get(name, shape[:-1])):
            raise InputError(
                f"{path}: gaussians.{name} has the shape {shape};"
                f" use {count} Gaussians on the last axis, as in position"
            )
    _refuse_odd_shapes(found, path)
    return Gaussians(**found)


def _refuse_odd_shapes(found: dict[str, NDArray], path: Path) -> None:
    """Raises InputError for wrong shapes of the arrays that depend on the settings: FDM, harmonics, residuals."""
    fdm = [found[name] for name in ("fdm_weight", "fdm_centre", "fdm_width")]
    shapes = {None if array is None else array.shape for array in fdm}
    shape = next(iter(shapes))
    if len(shapes) > 1 or (shape is not None and (len(shape) != 3 or shape[0] != DEFORMATION_CHANNELS)):
        shown = ", ".join("none" if array is None else str(array.shape) for array in fdm)
        raise InputError(
            f"{path}: gaussians.fdm_weight, fdm_centre and fdm_width have the shapes {shown}; use one shape,"
            f" ({DEFORMATION_CHANNELS}, bases, Gaussians)"
        )
    if found["harmonics"].shape[:-1] not in [(k, 3) for k in (1, 4, 9, 16)]:
        shown = found["harmonics"].shape
        raise InputError(f"{path}: gaussians.harmonics has the shape {shown}; use (1, 4, 9 or 16, 3, Gaussians)")
    for name in ("appearance_coefficients", "motion_coefficients"):
        array = found[name]
        if array is not None and (array.ndim != 3 or array.shape[0] != 3 or array.shape[1] % 2):
            raise InputError(
                f"{path}: gaussians.{name} has the shape {array.shape}; use (3, 2 x frequencies, Gaussians)"
            )


def _refuse_other_settings(found: Gaussians, model: ModelConfig, path: Path) -> None:
    """Raises InputError for arrays of another harmonic degree or number of frequencies than the settings."""
    seen = [("harmonics_degree", math.isqrt(len(found.harmonics)) - 1)]
    residuals = (found.appearance_coefficients, found.motion_coefficients)
    seen += [("frequencies", array.shape[1] // 2) for array in residuals if array is not None]
    for key, value in seen:
        if getattr(model, key) != value:
            raise InputError(
                f"{path}: model.{key} = {getattr(model, key)}, but its arrays have {value}; use settings and"
                " arrays of one run"
            )


def _exposures(frames: FrameParameters | None) -> FrameParameters | None:
    """The frame parameters stored in the file: exposures only, since its cameras include the pose correction."""
    if frames is None or frames.exposure_log_gain is None:
        return None
    return frames._replace(pose_rotation=None, pose_translation=None)


def _with_corrected_cameras(record: SequenceRecord, model: Model) -> SequenceRecord:
    """The record with the model's corrected cameras."""
    if pose_at(model.frames, 0.0) is None:
        return record
    cameras = corrected_cameras(model.frames, record.frame_cameras, record.times)
    return msgspec.structs.replace(record, cameras=recorded(cameras))


def _frames(entries: dict[str, NDArray], times: Any, path: Path) -> FrameParameters | None:
    if times is None:
        return None
    where = f"{path}: header: frame_times"
    times = [number(time, where) for time in listed(times, where)]
    found = [_entry(entries, f"frames.{name}", path) for name in ("exposure_log_gain", "exposure_bias")]
    if any(array is None or array.shape != (3, len(times)) for array in found):
        raise InputError(f"{path}: frames.exposure_*: two arrays for {len(times)} frames expected")
    return FrameParameters(np.array(times, np.float64), *found)


def _entry(entries: dict[str, NDArray], name: str, path: Path) -> Any:
    """An array as float32, removed from `entries`; None if it is missing."""
    array = entries.pop(name, None)
    if array is None:
        return None
    if array.dtype not in (np.float16, np.float32):
        raise InputError(f"{path}: {name} has type {array.dtype}; use float16 or float32")
    if not np.isfinite(array).all():
        raise InputError(f"{path}: {name} has numbers that are not finite; use finite ones")
    return np.ascontiguousarray(array, np.float32)
