"""Every reader of a file that another person may have made, with good files to start from and its mutation.

A reader may return or raise `InputError` (for the judge of ports `Refused`, for golden files also what its callers turn
into `InputError`). Anything else is a finding.
"""

import io
import json
import random
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import cv2
import msgspec
import mutate
import numpy as np
import recordings
from PIL import Image

from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.poses import cameras_of_rows, read_pose_rows
from endotsr.clips.sequences.record import record_of
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import DEMO, PAPER, SHARP, config_from_dict, config_to_toml, load_config
from endotsr.errors import InputError
from endotsr.port.judge.format import read_struct
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.schemas import SCHEMAS
from endotsr.results.evaluation.run import about_run
from endotsr.results.export.times import Times, chosen_times
from endotsr.results.report.curves import series
from endotsr.results.report.run_text import facts
from endotsr.results.views.plan import ViewRequest, check_request, planned_views
from endotsr.studies.sweeps.spec import read_spec
from endotsr.studies.tradeoff.scenes import read_splats
from endotsr.training.fitting.checkpoint import load_latest
from endotsr.training.fitting.state import new_training, save_state, state_from_checkpoint
from endotsr.training.runs.files import finite
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.log import RunLog, log_until
from endotsr.training.runs.model import Model, sequence_fingerprint
from endotsr.training.runs.records import REPORTED
from endotsr.training.runs.sources import run_source, start_record

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "golden"
CORPUS = Path(__file__).parent / "corpus"  # inputs that were findings once, by reader


class Reader(NamedTuple):
    """A reader under test."""

    name: str  # of the file that is written, with its ending
    seeds: Callable[[], list[bytes]]
    mutate: Callable[[random.Random, bytes], bytes]
    read: Callable[[Path], object]
    refuses: tuple[type[Exception], ...] = (InputError,)


def _png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


@cache
def png_seeds() -> list[bytes]:
    """Grey, colour and transparent pictures of 8 and 16 bits, one with a palette and one that is interlaced."""
    rng = np.random.default_rng(0)
    found = [_png(rng.integers(0, 255, shape, np.uint8)) for shape in ((5, 7), (6, 4, 3), (4, 4, 4))]
    found.append(_png(rng.integers(0, 65535, (5, 6), np.uint16)))
    out = io.BytesIO()
    Image.fromarray(rng.integers(0, 255, (9, 9), np.uint8)).convert("P").save(out, "png")
    return [*found, out.getvalue()]


def _saved(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


@cache
def pose_seeds() -> list[bytes]:
    """A static and a moving camera."""
    row = np.hstack([np.eye(3), np.zeros((3, 1)), [[32], [48], [40]]]).ravel()
    rows = np.tile(np.hstack([row, [0.0, 100.0]]), (9, 1))
    moving = rows.copy()
    moving[:, 3] = np.arange(9)
    return [_saved(rows), _saved(np.asfortranarray(moving)), _saved(moving.astype(np.float32))]


def read_poses(path: Path) -> object:
    """As the layout of EndoNeRF does."""
    return cameras_of_rows(read_pose_rows(path, 9), 48, 32, path)


@cache
def scene_seeds() -> list[bytes]:
    """A trained scene as an .npz file."""
    rng, count = np.random.default_rng(0), 6
    arrays = {"xyz": (count, 3), "log_scale": (count, 3), "quat_wxyz": (count, 4), "rgb": (count, 3)}
    entries = {name: rng.normal(size=shape).astype(np.float32) for name, shape in arrays.items()}
    out = io.BytesIO()
    np.savez(out, opacity=rng.uniform(size=count).astype(np.float32), **entries)
    return [out.getvalue()]


@cache
def ply_seeds() -> list[bytes]:
    """Four splats of degree 0."""
    names = ["x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity",
             "f_dc_0", "f_dc_1", "f_dc_2"]  # fmt: skip
    head = ["ply", "format binary_little_endian 1.0", "element vertex 4", *(f"property float {n}" for n in names)]
    body = np.random.default_rng(0).normal(size=(4, len(names))).astype("<f4").tobytes()
    return ["\n".join([*head, "end_header\n"]).encode() + body]


@cache
def toml_seeds() -> list[bytes]:
    """The settings of two presets."""
    return [config_to_toml(config).encode() for config in (DEMO, SHARP)]


def sweep_seeds() -> list[bytes]:
    text = """sequences = ["simulated"]
seeds = [0, 1, 2]
splits = ["every_second", "blocks 4"]
measures = ["depth"]
preset = "sharp"
iterations = 600
lpips = "weights.npz"
keep_checkpoints = false
simulator.frames = 9
settings.sequence.scale = 0.5
configurations.base.model.appearance = false
configurations."A from base".start = { configuration = "base", iteration = 300 }
configurations."A from base".density.until = 0
"""
    return [text.encode()]


@cache
def _tiny():
    settings = SimulatorSettings(width=32, height=24, frames=9)
    points = {"first_frame_points": 6, "other_frame_points": 2}
    config = config_from_dict({"initialisation": points, "training": {"iterations": 2}})
    return settings, simulate(settings).sequence, config


@cache
def checkpoint_seeds() -> list[bytes]:
    """The checkpoint of an untrained scene of eight Gaussians."""
    _, sequence, config = _tiny()
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "checkpoint.npz"
        save_state(path, new_training(sequence, config), config, "0" * 64)
        return [path.read_bytes()]


def read_checkpoint(path: Path) -> object:
    """As a resumed training does."""
    return state_from_checkpoint(load_latest(path)[0], PAPER)


@cache
def sequence_seeds() -> list[bytes]:
    """sequence.json of a static camera, and of one that moves."""
    _, sequence, _ = _tiny()
    record = msgspec.to_builtins(record_of(sequence))
    moving = record | {"static_camera": False, "cameras": record["cameras"] * 9}
    return [json.dumps(record).encode(), json.dumps(moving).encode()]


def read_sequence(path: Path) -> object:
    """As `endotsr render` does, up to the names of the pictures."""
    folder = RunFolder(path.parent)
    record = folder.sequence_record()
    requests = ViewRequest(Times(frames="all")), ViewRequest(Times(count=3), camera="sway", size="20x20")
    for request in requests:
        wanted = chosen_times("render", request.times, record)
        check_request(request, record.count)
        for view in planned_views(request, wanted, record.frame_cameras, pivot_depth=50.0):
            inside = (path.parent / f"{view.label}.png").resolve()
            assert inside.parent == path.parent.resolve(), f"{view.label!r} leaves the folder"
            assert view.camera.width > 0
    return record.train_times


@cache
def record_seeds() -> list[bytes]:
    """run.json."""
    settings, sequence, _ = _tiny()
    return [json.dumps(finite(start_record(["endotsr"], "simulated", sequence, DEMO, settings, 2))).encode()]


def read_record(path: Path) -> object:
    """As `endotsr evaluate` does."""
    folder = RunFolder(path.parent)
    record = folder.record(*REPORTED)
    run_source(folder)
    scene = type("Scene", (), {"count": 3})()
    return facts(about_run(record, Model(scene, None, DEMO, 5))), sequence_fingerprint(record)


@cache
def log_seeds() -> list[bytes]:
    """Six lines of a log."""
    rows = [{"iteration": i, "frame": 0, "loss": 0.5, "l1": 0.1, "gaussians": 9, "seconds": 0.01} for i in range(1, 7)]
    return [b"".join(json.dumps(row).encode() + b"\n" for row in rows)]


def read_log(path: Path) -> object:
    """As the report and a resumed training do."""
    log = log_until(path, 5)
    found = [series(log, key) for key in ("loss", "l1", "psnr", "seconds")]
    RunLog(path, 5).close()
    return found


def golden_json(kind: str) -> Callable[[Path], object]:
    return lambda path: read_struct(path, SCHEMAS[kind])


@cache
def manifest_seeds() -> list[bytes]:
    """The manifest, with a few of its files."""
    whole = json.loads((GOLDEN / "manifest.json").read_text())
    return [json.dumps(whole | {"files": whole["files"][:6]}).encode()]


@cache
def case_seeds() -> list[bytes]:
    """Three cases."""
    return [path.read_bytes() for path in sorted((GOLDEN / "cases").rglob("case.json"))[::40][:3]]


@cache
def request_seeds() -> list[bytes]:
    """A request to a port."""
    output = {"level": 1, "unit": "1", "dtype": "real", "shape": [3, 7]}
    request = {"family": "motion", "case": "generic", "operation": "motion", "settings": {"beta": 0.3},
               "inputs": {"phi": "inputs/phi.npy"}, "outputs": {"translation": output}}  # fmt: skip
    return [json.dumps(request).encode()]


def read_port_output(path: Path) -> object:
    """As the judge reads the outputs of a port."""
    return read_plain(path, path.parent)


READERS = {
    "png": Reader("a.png", png_seeds, mutate.png, read_png),
    "jpg": Reader("a.jpg", recordings.jpeg_seeds, mutate.plain, read_picture),
    "tiff": Reader("a.tiff", recordings.tiff_seeds, mutate.plain, recordings.read_depth),
    "tiff (colour)": Reader("a.tiff", partial(recordings.pillow_seeds, "tiff"), mutate.plain, read_picture),
    "webp": Reader("a.webp", partial(recordings.pillow_seeds, "webp"), mutate.plain, read_picture),
    "bmp": Reader("a.bmp", partial(recordings.pillow_seeds, "bmp"), mutate.plain, read_picture),
    "pfm": Reader("a.pfm", recordings.pfm_seeds, mutate.plain, recordings.read_depth),
    "depth (npy)": Reader("a.npy", pose_seeds, mutate.npy, recordings.read_depth),
    "video (mp4)": Reader("a.mp4", recordings.video_seeds, mutate.plain, recordings.read_video),
    "video (mkv)": Reader("a.mkv", partial(recordings.stream_seeds, "mkv"), mutate.plain, recordings.read_video),
    "video (avi)": Reader("a.avi", partial(recordings.stream_seeds, "avi"), mutate.riff, recordings.read_video),
    "video (ts)": Reader("a.ts", partial(recordings.stream_seeds, "ts"), mutate.packets, recordings.read_video),
    "video (mpg)": Reader("a.mpg", partial(recordings.stream_seeds, "mpg"), mutate.parts, recordings.read_video),
    "calibration (mat)": Reader("a.mat", recordings.matlab_seeds, mutate.mat, recordings.read_rig),
    "depth (mat)": Reader("a.mat", recordings.matlab_depth_seeds, mutate.mat, recordings.read_depth),
    "times of pictures": Reader("times.csv", recordings.times_seeds, mutate.lines, recordings.read_times),
    "sequence.toml": Reader(
        "sequence.toml", recordings.sequence_file_seeds, mutate.lines, recordings.read_sequence_file
    ),
    "calibration (ini)": Reader("StereoCalibration.ini", recordings.rig_seeds, mutate.lines, recordings.read_rig),
    "calibration (yaml)": Reader("rig.yaml", recordings.yaml_seeds, mutate.lines, recordings.read_rig),
    "calibration (xml)": Reader("rig.xml", recordings.storage_seeds, mutate.lines, recordings.read_rig),
    "trajectory": Reader("groundtruth.txt", recordings.trajectory_seeds, mutate.lines, recordings.read_trajectory),
    "list of pictures": Reader("rgb.txt", recordings.list_seeds, mutate.lines, recordings.read_list),
    "list of nanoseconds": Reader("data.csv", recordings.rows_seeds, mutate.lines, recordings.read_rows),
    "COLMAP (text)": Reader("model", recordings.colmap_seeds, mutate.lines, recordings.read_colmap),
    "COLMAP (binary)": Reader("model", recordings.colmap_binary_seeds, mutate.plain, recordings.read_colmap_binary),
    "cameras and points (npz)": Reader("a.npz", recordings.points_seeds, mutate.npz, recordings.read_points),
    "poses (npy)": Reader("poses_bounds.npy", pose_seeds, mutate.npy, read_poses),
    "splats (npz)": Reader("a.npz", scene_seeds, mutate.npz, read_splats),
    "splats (ply)": Reader("a.ply", ply_seeds, mutate.ply, read_splats),
    "settings (toml)": Reader("config.toml", toml_seeds, mutate.lines, load_config),
    "sweep (toml)": Reader("SPEC.toml", sweep_seeds, mutate.lines, read_spec),
    "checkpoint": Reader("checkpoint.npz", checkpoint_seeds, mutate.checkpoint, read_checkpoint),
    "run.json": Reader("run.json", record_seeds, mutate.tree, read_record),
    "sequence.json": Reader("sequence.json", sequence_seeds, mutate.tree, read_sequence),
    "log.jsonl": Reader("log.jsonl", log_seeds, mutate.jsonl, read_log),
    "golden manifest": Reader(
        "manifest.json", manifest_seeds, mutate.tree, golden_json("manifest"), (InputError, msgspec.DecodeError)
    ),
    "golden case": Reader("case.json", case_seeds, mutate.tree, golden_json("case"), (InputError, msgspec.DecodeError)),
    "request to a port": Reader(
        "request.json", request_seeds, mutate.tree, golden_json("request"), (InputError, msgspec.DecodeError)
    ),
    "output of a port (npy)": Reader("a.npy", pose_seeds, mutate.npy, read_port_output, (Refused,)),
}
