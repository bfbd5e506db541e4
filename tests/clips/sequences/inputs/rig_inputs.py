"""Rows of `inputs_tried.py` about recordings of rigs: the folder mav0/ of EuRoC as its tools write it."""

import shutil
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import Row, first_to_last, prepare, reworded
from left_inputs import matrices, squared, true_poses
from scipy.spatial.transform import Rotation
from silent_inputs import EUROC_HEAD, quaternions

from endotsr.clips.sequences.sequence_file import read_sequence_file

BEGIN, STEP = 1403636579763555584, 50_000_000  # nanoseconds: 20 pictures a second
SENSOR = """# General sensor definitions.
sensor_type: camera
comment: VI-Sensor {name} (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: {mount}

# Camera specific definitions.
rate_hz: 20
resolution: [160, 128]
camera_model: pinhole
intrinsics: [142.4, 142.4, 79.5, 63.5] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [0.0, 0.0, 0.0, 0.0]
"""


def mounted(shift: float = 0.0) -> np.ndarray:
    """T_BS of a camera, metres: turned by an arbitrary angle, and moved by `shift` along its x axis."""
    found = np.eye(4)
    found[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.2, 1.5]).as_matrix()
    found[:3, 3] = [-0.0216, -0.0647, 0.0098] + found[:3, 0] * shift
    return found


def write_camera(folder: Path, name: str, pictures: Path, shift: float) -> None:
    """A camera with data.csv, as EuRoC has it: a head line, and lines that end as on Windows."""
    (folder / name / "data").mkdir(parents=True)
    lines = ["#timestamp [ns],filename"]
    for k, file in enumerate(sorted(pictures.iterdir())):
        stamp = BEGIN + STEP * k
        shutil.copy(file, folder / name / f"data/{stamp}.png")
        lines.append(f"{stamp},{stamp}.png")
    (folder / name / "data.csv").write_bytes("\r\n".join([*lines, ""]).encode())
    text = SENSOR.format(name=name, mount=mounted(shift).ravel().tolist())
    (folder / name / "sensor.yaml").write_text(text)


def write_truth(folder: Path, cameras: np.ndarray, ticks: int = 4) -> None:
    """Poses of the body, `ticks` for each picture, from camera-to-world matrices (n, 4, 4) in millimetres."""
    cameras = cameras.copy()
    cameras[:, :3, 3] /= 1000
    bodies = np.repeat(cameras @ np.linalg.inv(mounted()), ticks, axis=0)
    (folder / "state_groundtruth_estimate0").mkdir()
    lines = [EUROC_HEAD]
    for k, (body, turn) in enumerate(zip(bodies, quaternions(bodies[:, :3], "wxyz"))):
        stamp = BEGIN + STEP // ticks * k
        lines.append(",".join([str(stamp), *(f"{v:.9f}" for v in (*body[:3, 3], *turn)), *["0.0"] * 9]))
    (folder / "state_groundtruth_estimate0/data.csv").write_bytes("\r\n".join([*lines, ""]).encode())
    sensor = "sensor_type: visual-inertial\ncomment: Vicon and Leica\nT_BS:\n  cols: 4\n  rows: 4\n  data: {}\n"
    (folder / "state_groundtruth_estimate0/sensor.yaml").write_text(sensor.format(np.eye(4).ravel().tolist()))


@builder
def rig(folder: Path, *words: str, second: bool = False, depth: bool = True, change=lambda raw: None) -> list[str]:
    """A moving scope as the folder mav0/ of EuRoC, with depth of another program beside it."""
    cameras = squared(matrices(folder))
    raw = folder / "raw/mav0"
    write_camera(raw, "cam0", folder / "clip/images", 0.0)
    if second:
        write_camera(raw, "cam1", folder / "clip/images_right", 0.004)
    write_truth(raw, cameras)
    change(raw)
    given = ["--depth", str(folder / "clip/depth"), "--pairing", "order"] if depth and not second else []
    return prepare("raw", *given, *words, camera=())(folder)


def true_rig(folder: Path, kept: slice = slice(None), baseline: float = 0.0) -> bool:
    """The written cameras are the true ones, and so are intrinsics, times and baseline."""
    found = read_sequence_file(folder / "o")
    times = np.arange(14)[kept] * STEP / 1e9
    stated = np.array(found.times) if found.times else np.arange(found.frames) / found.frame_rate
    return (
        true_poses(folder, kept, 1e-3)
        and np.allclose([found.camera.fx, found.camera.cx, found.camera.cy], [142.4, 80, 64], atol=1e-3)
        and np.allclose(stated - stated[0], times - times[0], atol=1e-4)
        and np.isclose(found.camera.baseline, baseline, atol=1e-4)
    )


@builder
def without(raw: Path, name: str) -> None:
    found = raw / name
    shutil.rmtree(found) if found.is_dir() else found.unlink()


def last_picture(camera: str):
    """The last picture of a camera is missing, or its row."""
    return f"{camera}/data/{BEGIN + 13 * STEP}.png"


def further_sensors(raw: Path) -> None:
    for name in ("imu0", "leica0"):
        (raw / name).mkdir()
        (raw / name / "data.csv").write_text("#timestamp [ns]\n1,2,3\n")
    (raw / "body.yaml").write_text("comment: the body\n")


def in_microseconds(text: str) -> str:
    lines = text.splitlines()
    return "\n".join([lines[0], *(f"{line[:16]},{line.split(',')[1]}" for line in lines[1:])])


MISSING = slice(None, -1)
RIG_ROWS = [
    Row("EuRoC, mav0/ with one camera and the ground truth", rig(), "told",
        "its poses and the T_BS of both sensors", true_rig),
    Row("EuRoC, a pair of cameras", rig(second=True), "told", "rectified: baseline 4 mm",
        lambda folder: true_rig(folder, baseline=4.0)),
    Row("EuRoC, mav0/ itself, further sensors", lambda folder: [word.replace("/raw", "/raw/mav0") for word in
        rig(change=further_sensors)(folder)], "told", "not read: imu0/, leica0/", true_rig),
    Row("EuRoC, a row without a picture", rig(depth=False, change=without(last_picture("cam0"))), "told",
        "without a picture, left out: 1403636580413555584.png", lambda folder: true_rig(folder, MISSING)),
    Row("EuRoC, a picture without a row", rig(depth=False, change=reworded("cam0/data.csv",
        first_to_last(0, -1))), "told",
        "without a line in data.csv, left out", lambda folder: true_rig(folder, MISSING)),
    Row("EuRoC, a right picture missing", rig(second=True, change=without(last_picture("cam1"))), "told",
        "cam0: without a picture of the other camera", lambda folder: true_rig(folder, MISSING, 4.0)),
    Row("EuRoC, cam1 without sensor.yaml", rig(second=True, change=without("cam1/sensor.yaml")), "told",
        "both cameras count as rectified", true_rig),
    Row("EuRoC, no ground truth", rig(change=without("state_groundtruth_estimate0")), "told",
        "the camera counts as static", lambda folder: read_sequence_file(folder / "o").poses is None),
    Row("EuRoC, the ground truth begins later", rig(change=reworded("state_groundtruth_estimate0/data.csv",
        lambda text: text.splitlines()[0] + "\n" + first_to_last(1 + 12)(text))), "refused",
        "3 of 14 frames have no pose"),
    Row("EuRoC, the ground truth has another clock", rig(change=reworded("state_groundtruth_estimate0/data.csv",
        lambda text: text.replace("\n1403", "\n1503"))), "refused", "no pose at the time of any picture"),
    Row("EuRoC, no T_BS", rig(change=reworded("cam0/sensor.yaml", lambda text: text.replace("T_BS", "pose"))),
        "refused", "T_BS is missing"),
    Row("EuRoC, fisheye", rig(change=reworded("cam0/sensor.yaml", lambda text: text.replace("radial-tangential",
        "equidistant"))), "refused", "distortion_model 'equidistant'"),
    Row("EuRoC, stamps in microseconds", rig(change=reworded("cam0/data.csv", in_microseconds)), "refused",
        "stamps in nanoseconds"),
    Row("EuRoC, two rows of one stamp", rig(change=reworded("cam0/data.csv", lambda text: text + f"{BEGIN},a.png\n")),
        "refused", "occurs twice"),
]  # fmt: skip
