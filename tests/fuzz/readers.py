"""Every reader of a file that another person may have made, with good files to start from and its mutation.

A reader may return or raise `InputError` (for the judge of ports `Refused`, for golden files also what its callers turn
into `InputError`). Anything else is a finding.
"""

import io
import json
import random
import struct
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

sys.path[:0] = [str(Path(__file__).parent)]

import msgspec  # noqa: E402
import mutate  # noqa: E402
import numpy as np  # noqa: E402

from endotsr.errors import InputError  # noqa: E402

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
    import cv2

    return cv2.imencode(".png", pixels)[1].tobytes()


@cache
def png_seeds() -> list[bytes]:
    """Grey, colour and transparent pictures of 8 and 16 bits, one with a palette and one that is interlaced."""
    from PIL import Image

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
    """As `read_endonerf` does."""
    from endotsr.sequences.poses import cameras_from_rows, read_pose_rows

    return cameras_from_rows(read_pose_rows(path, 9), 48, 32, path, range(9))


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


def read_splats(path: Path) -> object:
    from endotsr.tradeoff.splat_file import read_splats as read

    return read(path)


@cache
def toml_seeds() -> list[bytes]:
    """The settings of two presets."""
    from endotsr.config import DEMO, SHARP, config_to_toml

    return [config_to_toml(config).encode() for config in (DEMO, SHARP)]


def read_settings(path: Path) -> object:
    from endotsr.config import load_config

    return load_config(path)


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


def read_sweep(path: Path) -> object:
    from endotsr.sweeps.spec import read_spec

    return read_spec(path)


@cache
def _tiny():
    from endotsr.config import config_from_dict
    from endotsr.simulator.settings import SimulatorSettings
    from endotsr.simulator.simulate import simulate

    settings = SimulatorSettings(width=32, height=24, frames=9)
    points = {"first_frame_points": 6, "other_frame_points": 2}
    config = config_from_dict({"initialisation": points, "training": {"iterations": 2}})
    return settings, simulate(settings).sequence, config


@cache
def checkpoint_seeds() -> list[bytes]:
    """The checkpoint of an untrained scene of eight Gaussians."""
    import tempfile

    from endotsr.fitting.state import new_training, save_state

    _, sequence, config = _tiny()
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "checkpoint.npz"
        save_state(path, new_training(sequence, config), config, "0" * 64)
        return [path.read_bytes()]


def read_checkpoint(path: Path) -> object:
    """As a resumed training does."""
    from endotsr.config import PAPER
    from endotsr.fitting.checkpoint import load_latest
    from endotsr.fitting.state import state_from_checkpoint

    return state_from_checkpoint(load_latest(path)[0], PAPER)


@cache
def sequence_seeds() -> list[bytes]:
    """sequence.json of a static camera, and of one that moves."""
    from endotsr.runs.files import finite
    from endotsr.runs.sources import sequence_record

    _, sequence, _ = _tiny()
    record = finite(sequence_record(sequence))
    moving = record | {"static_camera": False, "cameras": record["cameras"] * 9}
    return [json.dumps(record).encode(), json.dumps(moving).encode()]


def read_sequence(path: Path) -> object:
    """As `endotsr render` does, up to the names of the pictures."""
    from endotsr.export.scene import RECORD
    from endotsr.export.times import Times
    from endotsr.runs.folder import RunFolder
    from endotsr.runs.sources import remembered_cameras
    from endotsr.views.plan import Request, check_request, views_of

    folder = RunFolder(path.parent)
    record = folder.sequence_record("names", "times", "train_index", "test_index")
    requests = Request(Times(frames="all")), Request(Times(count=3), camera="sway", size="20x20")
    for request in requests:
        check_request(request, record)
    folder.sequence_record(*RECORD)  # as the model asks when it is loaded
    for request in requests:
        for view in views_of(request, record, remembered_cameras(record), pivot_depth=50.0):
            inside = (path.parent / f"{view.label}.png").resolve()
            assert inside.parent == path.parent.resolve(), f"{view.label!r} leaves the folder"
            assert view.camera.width > 0
    return np.array(record["times"])[record["train_index"]]


@cache
def record_seeds() -> list[bytes]:
    """run.json."""
    from endotsr.config import DEMO
    from endotsr.runs.files import finite
    from endotsr.runs.training import start_record

    settings, sequence, _ = _tiny()
    return [json.dumps(finite(start_record(["endotsr"], "simulated", sequence, DEMO, settings, 2))).encode()]


def read_record(path: Path) -> object:
    """As `endotsr evaluate` does."""
    from endotsr.config import DEMO
    from endotsr.evaluation.run import _about_run
    from endotsr.report.run_text import facts
    from endotsr.runs.folder import RunFolder
    from endotsr.runs.model import Model, sequence_fingerprint
    from endotsr.runs.records import REPORTED
    from endotsr.runs.sources import run_source

    folder = RunFolder(path.parent)
    record = folder.record(*REPORTED)
    run_source(folder)
    scene = type("Scene", (), {"count": 3})()
    return facts({"run": _about_run(record, Model(scene, None, DEMO, 5))}), sequence_fingerprint(record)


@cache
def log_seeds() -> list[bytes]:
    """Six lines of a log."""
    rows = [{"iteration": i, "frame": 0, "loss": 0.5, "l1": 0.1, "gaussians": 9, "seconds": 0.01} for i in range(1, 7)]
    return [b"".join(json.dumps(row).encode() + b"\n" for row in rows)]


def read_log(path: Path) -> object:
    """As the report and a resumed training do."""
    from endotsr.report.curves import read_log as read
    from endotsr.report.curves import series
    from endotsr.runs.log import RunLog

    log = [entry for entry in read(path) if entry.get("iteration", 0) <= 5]
    found = [series(log, key) for key in ("loss", "l1", "psnr", "seconds")]
    RunLog(path, 5).close()
    return found


def golden_json(kind: str) -> Callable[[Path], object]:
    def read(path: Path) -> object:
        from endotsr.golden.judge.format import SCHEMAS, read_struct

        return read_struct(path, SCHEMAS[kind])

    return read


@cache
def jpeg_seeds() -> list[bytes]:
    """Colour and grey pictures of two qualities, one of them progressive."""
    import cv2

    rng = np.random.default_rng(0)
    colour, grey = rng.integers(0, 255, (17, 23, 3), np.uint8), rng.integers(0, 255, (16, 9), np.uint8)
    ways = ((colour, [cv2.IMWRITE_JPEG_QUALITY, 90]), (grey, []), (colour, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]))
    return [cv2.imencode(".jpg", pixels, way)[1].tobytes() for pixels, way in ways]


@cache
def tiff_seeds() -> list[bytes]:
    """Planes of 8 and 16 bits and of real numbers."""
    import cv2

    planes = [np.arange(63, dtype=kind).reshape(7, 9) for kind in (np.uint8, np.uint16, np.float32)]
    return [cv2.imencode(".tiff", plane)[1].tobytes() for plane in planes]


def pfm_seeds() -> list[bytes]:
    return [b"Pf\n5 4\n-1.0\n" + np.arange(20, dtype="<f4").tobytes()]


@cache
def video_seeds() -> list[bytes]:
    """Three pictures as .mp4, without loss and with."""
    import tempfile

    from endotsr.opencv.video import write_video

    pictures = list(np.random.default_rng(0).integers(0, 255, (3, 16, 24, 3), np.uint8))
    with tempfile.TemporaryDirectory() as scratch:
        files = [Path(scratch) / name for name in ("a.mp4", "b.mp4")]
        for file, lossless in zip(files, (True, False)):
            write_video(file, pictures, 5.0, lossless)
        return [file.read_bytes() for file in files]


def read_video(path: Path) -> object:
    """As `prepare` does, of at most three pictures."""
    from endotsr.opencv.video import video_facts, video_pictures

    return list(video_pictures(path, list(range(min(video_facts(path).count, 3)))))


def read_depth(path: Path) -> object:
    from endotsr.sequences.depth_files import depth_plane, read_plane

    return depth_plane(read_plane(path), 0.1, path)


def read_picture(path: Path) -> object:
    from endotsr.opencv.pictures import read_picture as read

    return read(path)


def sequence_file_seeds() -> list[bytes]:
    """sequence.toml with everything that it can hold."""
    row = "[1.0, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0]"
    text = f"""format = "endotsr-sequence-1"
source = "a clip"
frames = 2
unit = "mm"
frame_rate = 25.0

[camera]
width = 48
height = 32
fx = 40.0
fy = 41.0
cx = 24.0
cy = 16.0
distortion = []
baseline = 4.2

[masks]
folder = "masks"
excluded_value = "white"
proposed = false

[depth]
folder = "depth"
unit = "mm"
scale = 0.1
method = "given"

[poses]
direction = "camera_to_world"
axes = "opengl"
matrices = [{row}, {row}]
"""
    return [text.encode()]


def read_sequence_file(path: Path) -> object:
    from endotsr.sequences.sequence_file import read_poses
    from endotsr.sequences.sequence_file import read_sequence_file as read

    found = read(path.parent)
    return found.camera.lens(path), read_poses(found, path)


def rig_seeds() -> list[bytes]:
    """A stereo calibration."""
    lens = ["res_x=64", "res_y=48", "fc_x=60.5", "fc_y=61", "cc_x=32", "cc_y=24", *(f"kc_{k}=0.01" for k in range(8))]
    turn = [f"R_{k}={int(k % 4 == 0)}" for k in range(9)] + ["T_0=-4.2", "T_1=0", "T_2=0.1"]
    return ["\n".join(["[StereoLeft]", *lens, "", "[StereoRight]", *lens, *turn, ""]).replace("=", " = ").encode()]


def read_rig(path: Path) -> object:
    from endotsr.sequences.calibration import read_rig as read

    return read(path)


def trajectory_seeds() -> list[bytes]:
    """Poses by time and by number of the frame."""
    lines = [f"{stamp} 0.1 0.2 {k} 0 0 0 1" for k, stamp in enumerate(("1.50", "1.54", "1.58", "1.62"))]
    return ["\n".join(["# a comment", *lines, ""]).encode(), b"0 0 0 0 0 0 0 1\n1 0 0 0 0.6 0 0 0.8\n"]


def read_trajectory(path: Path) -> object:
    from endotsr.sequences.trajectory import filled, poses_of_frames
    from endotsr.sequences.trajectory import read_trajectory as read

    poses = poses_of_frames(read(path, "m", axes="opengl"), 4, 25.0)[0]
    return filled(poses) if any(pose is not None for pose in poses) else poses


def read_list(path: Path) -> object:
    from endotsr.sequences.layouts.tum import read_list as read

    found = read(path)
    assert all(file.resolve().is_relative_to(path.parent.resolve()) for file in found[1])
    return found


COLMAP_TEXT = (
    b"1 OPENCV 64 48 60 61 32 24 0.01 0 0 0\n2 SIMPLE_RADIAL 64 48 60 32 24 0.1\n",
    b"1 1 0 0 0 0.1 0.2 0.3 1 a.png\n1.5 2.5 7 3 4 -1\n2 0.6 0.8 0 0 0 0 0 2 b/c d.png\n\n",
    b"7 1.5 2.5 3.5 255 0 0 0.5 1 0 2 1\n9 1 1 1 0 0 0 0\n",
)


def colmap_seeds() -> list[bytes]:
    """The three text files of a model, one after another, between lines of dashes."""
    return [b"----\n".join(COLMAP_TEXT)]


def read_colmap(path: Path) -> object:
    """The three files apart; what is missing is empty."""
    from endotsr.sequences.colmap_model import read_model

    parts = path.read_bytes().split(b"----\n")[:3]
    for name, part in zip(("cameras", "images", "points3D"), [*parts, b"", b""]):
        (path.parent / f"{name}.txt").write_bytes(part)
    return read_model(path.parent)


@cache
def colmap_binary_seeds() -> list[bytes]:
    """cameras, images and points3D in the binary form, each after its length."""
    cameras = struct.pack("<QiiQQ8d", 1, 1, 4, 64, 48, 60, 61, 32, 24, 0.01, 0, 0, 0)
    pose = struct.pack("<i7di", 1, 1, 0, 0, 0, 0.1, 0.2, 0.3, 1)
    images = struct.pack("<Q", 1) + pose + b"a.png\0" + struct.pack("<Qddqddq", 2, 1.5, 2.5, 7, 3, 4, -1)
    points = struct.pack("<QQdddBBBdQii", 1, 7, 1.5, 2.5, 3.5, 255, 0, 0, 0.5, 1, 1, 0)
    return [b"".join(struct.pack("<I", len(part)) + part for part in (cameras, images, points))]


def read_colmap_binary(path: Path) -> object:
    from endotsr.sequences.colmap_model import read_model

    data = path.read_bytes()
    for name in ("cameras", "images", "points3D"):
        length = int.from_bytes(data[:4], "little")
        (path.parent / f"{name}.bin").write_bytes(data[4 : 4 + length])
        data = data[4 + length :]
    return read_model(path.parent)


@cache
def points_seeds() -> list[bytes]:
    """Cameras and points of two pictures."""
    out = io.BytesIO()
    np.savez(out, w2c=np.tile(np.eye(4), (2, 1, 1)), K=np.diag([60.0, 60.0, 1.0]), points=np.zeros((3, 3)),
             visible=np.ones((3, 2), bool), frame_ids=np.arange(2))  # fmt: skip
    return [out.getvalue()]


def read_points(path: Path) -> object:
    from endotsr.sequences.layouts.points import read_cameras

    return read_cameras(path, [path.parent / "0.png", path.parent / "1.png"])


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
    from endotsr.golden.judge.npy import read_plain

    return read_plain(path, path.parent)


def read_png(path: Path) -> object:
    from endotsr.opencv import read_png as read

    return read(path)


def _refused() -> type[Exception]:
    from endotsr.golden.judge.npy import Refused

    return Refused


READERS = {
    "png": Reader("a.png", png_seeds, mutate.png, read_png),
    "jpg": Reader("a.jpg", jpeg_seeds, mutate.plain, read_picture),
    "tiff": Reader("a.tiff", tiff_seeds, mutate.plain, read_depth),
    "pfm": Reader("a.pfm", pfm_seeds, mutate.plain, read_depth),
    "depth (npy)": Reader("a.npy", pose_seeds, mutate.npy, read_depth),
    "video (mp4)": Reader("a.mp4", video_seeds, mutate.plain, read_video),
    "sequence.toml": Reader("sequence.toml", sequence_file_seeds, mutate.lines, read_sequence_file),
    "calibration (ini)": Reader("StereoCalibration.ini", rig_seeds, mutate.lines, read_rig),
    "trajectory": Reader("groundtruth.txt", trajectory_seeds, mutate.lines, read_trajectory),
    "list of pictures": Reader("rgb.txt", trajectory_seeds, mutate.lines, read_list),
    "COLMAP (text)": Reader("model", colmap_seeds, mutate.lines, read_colmap),
    "COLMAP (binary)": Reader("model", colmap_binary_seeds, mutate.plain, read_colmap_binary),
    "cameras and points (npz)": Reader("a.npz", points_seeds, mutate.npz, read_points),
    "poses (npy)": Reader("poses_bounds.npy", pose_seeds, mutate.npy, read_poses),
    "splats (npz)": Reader("a.npz", scene_seeds, mutate.npz, read_splats),
    "splats (ply)": Reader("a.ply", ply_seeds, mutate.ply, read_splats),
    "settings (toml)": Reader("config.toml", toml_seeds, mutate.lines, read_settings),
    "sweep (toml)": Reader("SPEC.toml", sweep_seeds, mutate.lines, read_sweep),
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
    "output of a port (npy)": Reader("a.npy", pose_seeds, mutate.npy, read_port_output, (_refused(),)),
}
