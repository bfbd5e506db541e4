"""Rows of `inputs_tried.py` about the layouts of public data sets: EuRoC, TUM, KITTI, SCARED, Hamlyn and others."""

import json
import shutil
from pathlib import Path

import numpy as np
import raw_sources
from builders import builder
from input_kinds import (
    BEGIN,
    EUROC_HEAD,
    STEP,
    Row,
    calibrated,
    centred,
    first_to_last,
    matrices,
    moving,
    prepare,
    public,
    quaternions,
    raw,
    reworded,
    size,
    squared,
    timed,
    true_rig,
    with_files,
)
from public_layouts import K as PUBLIC_K
from public_layouts import poses as public_poses
from raw_sources import stereomis
from scipy.spatial.transform import Rotation

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file
from synthetic_folder import write_synthetic_folder

KITTI = "".join(f"P{k}: 100 0 63.5 {b} 0 100 47.5 0 0 0 1 0\n" for k, b in enumerate((0, -40, 10, -30)))


def with_associations(folder: Path) -> None:
    (folder / "associations.txt").write_text("100.0 rgb/0.png 100.043 depth/1.png\n")


@builder
def public_endonerf(folder: Path, *names: str) -> list[str]:
    """A simulated EndoNeRF folder without masks, with further files."""
    moving(folder)
    raw = folder / "clip"
    for name in ("masks", "gt_masks"):
        shutil.rmtree(raw / name, ignore_errors=True)
    for name in names:
        if name.endswith(".npy"):
            shutil.copy(raw / "poses_bounds.npy", raw / name)
        else:
            with_files(name)(raw)
    return prepare("clip", camera=())(folder)


def of_orb_slam(folder: Path) -> None:
    """A TUM folder as ORB-SLAM leaves it: its trajectory and its settings, no true one."""
    (folder / "groundtruth.txt").rename(folder / "CameraTrajectory.txt")
    lens = "Camera.fx: 60\nCamera.fy: 60\nCamera.cx: 31.5\nCamera.cy: 23.5\nDepthMapFactor: 5000\n"
    (folder / "TUM1.yaml").write_text("%YAML:1.0\nCamera.type: PinHole\n" + lens)


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


def one_file_more(raw: Path) -> None:
    pose = {"camera-pose": np.eye(4).tolist()}
    (raw / "data/frame_data/frame_data000007.json").write_text(json.dumps(pose))


def with_calibrations(raw: Path) -> None:
    for file in (raw / "data/frame_data").iterdir():
        stored = json.loads(file.read_text())
        file.write_text(json.dumps(stored | {"camera-calibration": {"KL": PUBLIC_K.tolist()}, "timestamp": 1.0}))


def as_downloaded(raw: Path) -> None:
    """The other files of a keyframe."""
    with_files("left_depth_map.tiff", "right_depth_map.tiff", "point_cloud.obj", "Left_Image.png",
               "Right_Image.png")(raw)  # fmt: skip
    (raw / "endoscope_calibration.yaml").rename(raw / "camera_calibration.yaml")


@builder
def true_at(folder: Path, *frames: int) -> bool:
    """The poses of these frames are the true ones."""
    found = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    return all(np.allclose(found[k], public_poses()[k][:3], atol=1e-4) for k in frames)


def other_cameras(raw: Path) -> None:
    for file in (raw / "Rectified_calibration").iterdir():
        stored = json.loads(file.read_text())
        stored["P2"]["data"][0] = 110.0
        file.write_text(json.dumps(stored))


def no_focal_length(folder: Path) -> list[str]:
    """The EndoNeRF layout with a negative focal length in every row."""
    write_synthetic_folder(folder / "clip")
    rows = np.load(folder / "clip/poses_bounds.npy")
    rows[:, 14] = -rows[:, 14]
    np.save(folder / "clip/poses_bounds.npy", rows)
    return ["check", str(folder / "clip")]


def steps_per_metre(steps: int, key: str = "DepthMapFactor"):
    """A TUM folder whose settings of ORB-SLAM state the steps of its depth, usually 5000 a metre."""

    def change(folder: Path) -> None:
        of_orb_slam(folder)
        reworded("TUM1.yaml", lambda text: text.replace("DepthMapFactor: 5000", f"{key}: {steps}"))(folder)

    return raw(raw_sources.tum, change=change)


@builder
def median_depth(folder: Path, millimetres: float) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return entry is not None and np.isclose(
        np.median(read_png(folder / "o/depth/000000.png")) * entry.scale, millimetres, rtol=1e-3
    )


DATASET_ROWS = [
    Row("EuRoC, mav0/ with one camera and the ground truth", rig(), "told", "its poses and the T_BS of both sensors",
        true_rig),
    Row("EuRoC, a pair of cameras", rig(second=True), "told", "rectified: baseline 4 mm",
        lambda folder: true_rig(folder, baseline=4.0)),
    Row("EuRoC, mav0/ itself, further sensors", lambda folder: [word.replace("/raw",
        "/raw/mav0") for word in rig(change=further_sensors)(folder)], "told", "not read: imu0/, leica0/", true_rig),
    Row("EuRoC, a row without a picture", rig(depth=False, change=without(last_picture("cam0"))), "told",
        "without a picture, left out: 1403636580413555584.png", lambda folder: true_rig(folder, MISSING)),
    Row("EuRoC, a picture without a row", rig(depth=False, change=reworded("cam0/data.csv", first_to_last(0, -1))),
        "told", "without a line in data.csv, left out", lambda folder: true_rig(folder, MISSING)),
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
    Row("TUM, associations", raw(raw_sources.tum, change=with_associations, camera=("--camera", "60", "61", "30",
        "25")), "told", "associations.txt: not read; pictures, depth and poses are paired by their times"),
    Row("TUM, trajectory and settings of ORB-SLAM", raw(raw_sources.tum, change=of_orb_slam), "told",
        "poses of CameraTrajectory.txt", lambda folder: np.isclose(read_sequence_file(folder / "o").camera.cx, 32)),
    Row("TUM in nanoseconds", tum(tum_in_nanoseconds), "right", "", tum_kept),
    Row("TUM, a picture without a line", tum(lambda raw: write_png(raw / "rgb/99.png", raw_sources.scene_picture(9))),
        "told", "without a line in rgb.txt, left out: 99.png", tum_kept),
    Row("TUM, settings that state the steps of the depth", steps_per_metre(1000), "told",
        "TUM1.yaml: DepthMapFactor: the depth has 1000 steps per metre", median_depth(300)),
    Row("TUM, settings of ORB-SLAM3 that state the steps of the depth", steps_per_metre(1000, "RGBD.DepthMapFactor"),
        "told", "RGBD.DepthMapFactor: the depth has 1000 steps per metre", median_depth(300)),
    Row("KITTI, image_2 and image_3", calibrated("calib.txt", KITTI, folders=("image_2", "image_3")), "told",
        "P0 and P1 are read"),
    Row("SCARED", public("scared"), "told", "read as world-to-camera",
        lambda folder: len(read_sequence_file(folder / "o").poses.matrices) == 4),
    Row("SCARED, the file of a frame is missing", unpacked(lambda raw: (raw /
        "data/frame_data/frame_data000001.json").unlink()), "told", "1 of 4 frames have no pose", true_at(0, 2, 3)),
    Row("SCARED, a file of no frame", unpacked(one_file_more), "told", "of no frame, not used: frame_data000007.json",
        true_at(0, 1, 2, 3)),
    Row("SCARED, a calibration in every frame", unpacked(with_calibrations), "told",
        "camera-calibration: the calibration of the keyframe is used", true_at(0, 1, 2, 3)),
    Row("SCARED, as downloaded", unpacked(as_downloaded), "told", "left_depth_map.tiff: structured light", true_at(0, 1,
        2, 3)),
    Row("SERV-CT", public("servct"), "told", "not for training one scene", centred),
    Row("SERV-CT, P1 and P2 differ", public("servct", change=other_cameras), "refused", "use one camera"),
    Row("Hamlyn", public("hamlyn", "--baseline", "5"), "told", "half a pixel was added", centred),
    Row("Hamlyn, two folders of left pictures", public("hamlyn", "--baseline", "5",
        change=lambda raw: shutil.copytree(raw / "image01", raw / "color")), "told", "not read: image01/", centred),
    Row("C3VD", public("c3vd", "--scale", "0.1"), "told", "undistorted to a pinhole camera", size(135, 108)),
    Row("EndoNeRF, masks in gt_masks alone", public_endonerf("gt_masks/0.png"), "told", "not read: gt_masks/"),
    Row("EndoNeRF, a second pose file", public_endonerf("pose_bounds.npy"), "told", "not read: pose_bounds.npy"),
    Row("EndoNeRF, a negative focal length", no_focal_length, "refused", "must be positive"),
    Row("StereoMIS, a mask missing, --gaps drop", raw(stereomis, "--gaps", "drop",
        change=lambda raw: (raw / "masks/000002l.png").unlink()), "told", "not evenly spaced", timed((0, 40, 120, 160,
        200))),
]  # fmt: skip
