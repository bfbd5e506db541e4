"""Rows of `inputs_tried.py` about the layouts of public data sets: EuRoC, TUM, KITTI, SCARED, Hamlyn and others."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import raw_sources
from builders import builder
from input_kinds import (
    EUROC_HEAD,
    P,
    calibrated,
    first_to_last,
    matrices,
    moving,
    prepare,
    public,
    quaternions,
    raw,
    replaced,
    reworded,
    squared,
    with_files,
    without,
)
from input_rows import BEGIN, STEP, centred, refused, right, size, timed, told, true_rig
from public_layouts import K as PUBLIC_K
from public_layouts import poses as public_poses
from raw_sources import stereomis
from scipy.spatial.transform import Rotation

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file
from synthetic_folder import write_synthetic_folder

KITTI = "".join(P.format(f"P{k}", b) for k, b in enumerate((0, -40, 10, -30)))


@builder
def endonerf(folder: Path, *names: str) -> list[str]:
    """A simulated EndoNeRF folder without masks, with further files."""
    moving(folder)
    for name in ("masks", "gt_masks"):
        shutil.rmtree(folder / "clip" / name, ignore_errors=True)
    with_files(*names)(folder / "clip")
    return prepare("clip", camera=())(folder)


@builder
def of_orb_slam(folder: Path, steps: str = "DepthMapFactor: 5000") -> None:
    """A TUM folder as ORB-SLAM leaves it: its trajectory and its settings, no true one."""
    (folder / "groundtruth.txt").rename(folder / "CameraTrajectory.txt")
    lens = "Camera.fx: 60\nCamera.fy: 60\nCamera.cx: 31.5\nCamera.cy: 23.5\n"
    (folder / "TUM1.yaml").write_text(f"%YAML:1.0\nCamera.type: PinHole\n{lens}{steps}\n")


SENSOR = """# General sensor definitions.
sensor_type: camera
comment: VI-Sensor {name} (MT9M034)

T_BS:
  cols: 4
  rows: 4
  data: {mount}
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
    metres = np.concatenate([cameras[:, :, :3], cameras[:, :, 3:] * [[1e-3], [1e-3], [1e-3], [1]]], axis=2)
    bodies = np.repeat(metres @ np.linalg.inv(mounted()), ticks, axis=0)
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


LAST = f"data/{BEGIN + 13 * STEP}.png"
MISSING = slice(None, -1)


def tum(change):
    return raw(raw_sources.tum, change=change, camera=("--camera", "60", "60", "32", "24"))


def tum_in_nanoseconds(raw: Path) -> None:
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        rows = [line.split() for line in (raw / name).read_text().splitlines() if not line.startswith("#")]
        stamped = [" ".join([str(round((1.4e9 + float(row[0])) * 1e9)), *row[1:]]) for row in rows]
        (raw / name).write_text("\n".join(stamped))


def tum_kept(folder: Path) -> bool:
    found = read_sequence_file(folder / "o")
    return found.frames == 5 and np.isclose(found.frame_rate, 25, atol=0.01) and found.poses is not None


def unpacked(change):
    """A keyframe of SCARED with the files of the frames in a folder."""
    return public("scared", "--gaps", "fill", archive=False, change=change)


@builder
def stored(folder: Path, pattern: str, change) -> None:
    """JSON files with further keys, computed from the stored ones."""
    for file in folder.glob(pattern):
        found = json.loads(file.read_text())
        file.write_text(json.dumps(found | change(found)))


UNPACKED = "data/frame_data/frame_data00000"
NO_MOTION = json.dumps({"camera-pose": np.eye(4).tolist()})


def as_downloaded(raw: Path) -> None:
    """The other files of a keyframe."""
    with_files("left_depth_map.tiff", "right_depth_map.tiff", "point_cloud.obj", "Left_Image.png")(raw)
    (raw / "endoscope_calibration.yaml").rename(raw / "camera_calibration.yaml")


@builder
def true_at(folder: Path, *frames: int) -> bool:
    """The poses of these frames are the true ones."""
    found = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    return all(np.allclose(found[k], public_poses()[k][:3], atol=1e-4) for k in frames)


def no_focal_length(folder: Path) -> list[str]:
    """The EndoNeRF layout with a negative focal length in every row."""
    write_synthetic_folder(folder / "clip")
    rows = np.load(folder / "clip/poses_bounds.npy")
    rows[:, 14] = -rows[:, 14]
    np.save(folder / "clip/poses_bounds.npy", rows)
    return ["check", str(folder / "clip")]


@builder
def median_depth(folder: Path, millimetres: float) -> bool:
    found = np.median(read_png(folder / "o/depth/000000.png")) * read_sequence_file(folder / "o").depth.scale
    return np.isclose(found, millimetres, rtol=1e-3)


DATASET_ROWS = [
    told("EuRoC, mav0/ with one camera and the ground truth", rig(), "its poses and the T_BS of both sensors",
        true_rig),
    told("EuRoC, a pair of cameras", rig(second=True), "rectified: baseline 4 mm", lambda folder: true_rig(folder,
        baseline=4.0)),
    told("EuRoC, mav0/ itself, further sensors", lambda folder: [word.replace("/raw",
        "/raw/mav0") for word in rig(change=with_files("imu0/data.csv", "leica0/data.csv", "body.yaml"))(folder)],
        "not read: imu0/, leica0/", true_rig),
    told("EuRoC, a row without a picture", rig(depth=False, change=without(f"cam0/{LAST}")),
        "without a picture, left out: 1403636580413555584.png", lambda folder: true_rig(folder, MISSING)),
    told("EuRoC, a picture without a row", rig(depth=False, change=reworded("cam0/data.csv", first_to_last(0, -1))),
        "without a line in data.csv, left out", lambda folder: true_rig(folder, MISSING)),
    told("EuRoC, a right picture missing", rig(second=True, change=without(f"cam1/{LAST}")),
        "cam0: without a picture of the other camera", lambda folder: true_rig(folder, MISSING, 4.0)),
    told("EuRoC, cam1 without sensor.yaml", rig(second=True, change=without("cam1/sensor.yaml")),
        "both cameras count as rectified", true_rig),
    told("EuRoC, no ground truth", rig(change=without("state_groundtruth_estimate0")), "the camera counts as static",
        lambda folder: read_sequence_file(folder / "o").poses is None),
    refused("EuRoC, the ground truth begins later", rig(change=reworded("state_groundtruth_estimate0/data.csv",
        lambda text: text.splitlines()[0] + "\n" + first_to_last(1 + 12)(text))), "3 of 14 frames have no pose"),
    refused("EuRoC, the ground truth has another clock", rig(change=replaced("state_groundtruth_estimate0/data.csv",
        "\n1403", "\n1503")), "no pose at the time of any picture"),
    refused("EuRoC, no T_BS", rig(change=replaced("cam0/sensor.yaml", "T_BS", "pose")), "T_BS is missing"),
    refused("EuRoC, fisheye", rig(change=replaced("cam0/sensor.yaml", "radial-tangential", "equidistant")),
        "distortion_model 'equidistant'"),
    refused("EuRoC, stamps in microseconds", rig(change=reworded("cam0/data.csv",
        lambda text: re.sub(r"(?m)^(\d{16})\d{3},", r"\1,", text))), "stamps in nanoseconds"),
    refused("EuRoC, two rows of one stamp", rig(change=reworded("cam0/data.csv",
        lambda text: text + f"{BEGIN},a.png\n")), "occurs twice"),
    told("TUM, associations", tum(with_files("associations.txt", text="100.0 rgb/0.png 100.043 depth/1.png\n")),
        "associations.txt: not read; pictures, depth and poses are paired by their times"),
    told("TUM, trajectory and settings of ORB-SLAM", raw(raw_sources.tum, change=of_orb_slam()),
        "poses of CameraTrajectory.txt", lambda folder: np.isclose(read_sequence_file(folder / "o").camera.cx, 32)),
    right("TUM in nanoseconds", tum(tum_in_nanoseconds), tum_kept),
    told("TUM, a picture without a line", tum(lambda raw: write_png(raw / "rgb/99.png", raw_sources.scene_picture(9))),
        "without a line in rgb.txt, left out: 99.png", tum_kept),
    told("TUM, settings that state the steps of the depth", raw(raw_sources.tum,
        change=of_orb_slam("DepthMapFactor: 1000")), "TUM1.yaml: DepthMapFactor: the depth has 1000 steps per metre",
        median_depth(300)),
    told("TUM, settings of ORB-SLAM3 that state the steps of the depth", raw(raw_sources.tum,
        change=of_orb_slam("RGBD.DepthMapFactor: 1000")), "RGBD.DepthMapFactor: the depth has 1000 steps per metre",
        median_depth(300)),
    told("KITTI, image_2 and image_3", calibrated("calib.txt", KITTI, folders=("image_2", "image_3")),
        "P0 and P1 are read"),
    told("SCARED", public("scared"), "read as world-to-camera",
        lambda folder: len(read_sequence_file(folder / "o").poses.matrices) == 4),
    told("SCARED, the file of a frame is missing", unpacked(without(f"{UNPACKED}1.json")), "1 of 4 frames have no pose",
        true_at(0, 2, 3)),
    told("SCARED, a file of no frame", unpacked(with_files(f"{UNPACKED}7.json", text=NO_MOTION)),
        "of no frame, not used: frame_data000007.json", true_at(0, 1, 2, 3)),
    told("SCARED, a calibration in every frame", unpacked(stored("data/frame_data/*",
        lambda found: {"camera-calibration": {"KL": PUBLIC_K.tolist()}, "timestamp": 1.0})),
        "camera-calibration: the calibration of the keyframe is used", true_at(0, 1, 2, 3)),
    told("SCARED, as downloaded", unpacked(as_downloaded), "left_depth_map.tiff: structured light", true_at(0, 1, 2,
        3)),
    told("SERV-CT", public("servct"), "not for training one scene", centred),
    refused("SERV-CT, P1 and P2 differ", public("servct", change=stored("Rectified_calibration/*",
        lambda found: {"P2": found["P2"] | {"data": [110.0, *found["P2"]["data"][1:]]}})), "use one camera"),
    told("Hamlyn", public("hamlyn", "--baseline", "5"), "half a pixel was added", centred),
    told("Hamlyn, two folders of left pictures", public("hamlyn", "--baseline", "5",
        change=lambda raw: shutil.copytree(raw / "image01", raw / "color")), "not read: image01/", centred),
    told("C3VD", public("c3vd", "--scale", "0.1"), "undistorted to a pinhole camera", size(135, 108)),
    told("EndoNeRF, masks in gt_masks alone", endonerf("gt_masks/0.png"), "not read: gt_masks/"),
    told("EndoNeRF, a second pose file", endonerf("pose_bounds.npy"), "not read: pose_bounds.npy"),
    refused("EndoNeRF, a negative focal length", no_focal_length, "must be positive"),
    told("StereoMIS, a mask missing, --gaps drop", raw(stereomis, "--gaps", "drop",
        change=without("masks/000002l.png")), "not evenly spaced", timed((0, 40, 120, 160, 200))),
]  # fmt: skip
