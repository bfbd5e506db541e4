"""Rows of `inputs_tried.py` about fields that a reader passed over: columns, rows of matrices, lines, models, marks."""

import shutil
import struct
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from input_kinds import Row, calibrated, centred, public
from left_inputs import colmap, squared, true_poses, with_poses
from made_videos import pictures
from odd_inputs import two_folders, with_trajectory

from endotsr.clips.sequences.sequence_file import read_sequence_file

K = [100.0, 0, 63.5, 0, 101, 47.5, 0, 0, 1]
ROS_ECHO = """header:
  seq: {seq}
  stamp: {{secs: {seq}, nsecs: 0}}
height: 96
width: 128
distortion_model: plumb_bob
D: [0.0, 0.0, 0.0, 0.0, 0.0]
K: [100.0, 0.0, 63.5, 0.0, 101.0, 47.5, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [100.0, 0.0, 63.5, 0.0, 0.0, 101.0, 47.5, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {{x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}}
---
"""
ORB = (
    "%YAML:1.0\nCamera.type: {}\nCamera.fx: 100.0\nCamera.fy: 101.0\nCamera.cx: 63.5\nCamera.cy: 47.5\nCamera.k1: {}\n"
)
EUROC = "sensor_type: camera\nresolution: [128, 96]\ncamera_model: pinhole\nintrinsics: [100, 101, 63.5, 47.5]\n"
FISHEYE = "K: {data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]}\nD: {data: [0.01, 0., 0., 0.]}\n"


def quaternions(found: np.ndarray, order: str = "xyzw") -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(found[:, :, :3]).as_quat()[:, ["xyzw".index(axis) for axis in order]]


def headed(head: str, delimiter: str = " "):
    return lambda path, rows: np.savetxt(path, rows, delimiter=delimiter, header=head, comments="")


def turned_first(found: np.ndarray) -> np.ndarray:
    """The quaternion before the position."""
    return np.column_stack([np.arange(len(found)), quaternions(found), found[:, :, 3]])


def of_euroc(found: np.ndarray) -> np.ndarray:
    """Seventeen columns: nanoseconds, position, w x y z, velocity and two biases."""
    stamps = 1403636579763555584 + 4e7 * np.arange(len(found))
    return np.column_stack([stamps, found[:, :, 3], quaternions(found, "wxyz"), np.zeros((len(found), 9))])


EUROC_HEAD = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m"
    " s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1],"
    " b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
)


def twice_as_often(found: np.ndarray) -> np.ndarray:
    """Nanoseconds, and a second pose between two frames."""
    both = np.repeat(found, 2, axis=0)
    stamps = 1403636579763555584 + 2e7 * np.arange(len(both))
    return np.column_stack([stamps, both[:, :, 3], quaternions(both)])


def transposed(found: np.ndarray) -> np.ndarray:
    return squared(found).transpose(0, 2, 1)


def at_25_hz(make):
    return lambda folder: [*make(folder), "--source-rate", "25"]


def without_lines_of_points(raw: Path) -> None:
    file = raw / "sparse/0/images.txt"
    file.write_text("\n".join(file.read_text().splitlines()[::2]) + "\n")


def longer(name: str):
    """A binary file with bytes behind its last entry, as another version of its format has."""

    def change(raw: Path) -> None:
        file = raw / f"sparse/0/{name}.bin"
        file.write_bytes(file.read_bytes() + bytes(16))

    return change


def both_forms(raw: Path) -> None:
    """An older binary model beside the text model."""
    for name in ("cameras", "images", "points3D"):
        (raw / f"sparse/0/{name}.bin").write_bytes(struct.pack("<Q", 0))


def cloud(form: str, names: str = "x y z", more: str = "", tail: bytes = b""):
    """Points in the place of depth, in `sparse_pc.ply`, with the first property in the last column."""

    def change(raw: Path) -> None:
        shutil.rmtree(raw / "depth")
        rng = np.random.default_rng(0)
        spread = rng.uniform((-0.03, -0.02, 0.05), (0.03, 0.02, 0.05), (60, 3)).astype("f4")
        columns = [spread[:, "xyz".index(name)] if name in "xyz" else np.full(60, 200, "f4") for name in names.split()]
        properties = "".join(f"property float {name}\n" for name in names.split())
        rows = np.stack(columns, axis=1)
        body = {"ascii": "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist()).encode(),
                "binary_little_endian": rows.astype("<f4").tobytes(),
                "binary_big_endian": rows.astype(">f4").tobytes()}[form]  # fmt: skip
        head = f"ply\nformat {form} 1.0\nelement vertex 60\n{properties}{more}end_header\n"
        (raw / "sparse_pc.ply").write_bytes(head.encode() + body + tail)

    return public("nerfstudio", with_depth=False, ply_file_path="sparse_pc.ply", change=change)


def flat_depth(folder: Path) -> bool:
    """The points are on a plane: all depths that were written are equal."""
    from endotsr.clips.opencv import read_png

    seen = read_png(folder / "o/depth/000000.png")
    return bool((seen > 0).mean() > 0.2 and np.ptp(seen[seen > 0]) <= 1)


def transposed_matrices(raw: Path) -> None:
    import json

    file = raw / "transforms.json"
    data = json.loads(file.read_text())
    for entry in data["frames"]:
        entry["transform_matrix"] = np.array(entry["transform_matrix"]).T.tolist()
    file.write_text(json.dumps(data))


def with_baseline(value: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.baseline, value)


def kitti_pair(folder: Path) -> list[str]:
    words = two_folders(pictures(), pictures())(folder)
    across = [100.0, 0, 63.5, -0.4, 0, 101, 47.5, 0, 0, 0, 1, 0]
    own = across[:3] + [0.0] + across[4:]
    text = "\n".join(f"P{k}: {' '.join(map(str, row))}" for k, row in enumerate((own, across)))
    (folder / "calib.txt").write_text(text + "\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    return [*words[: words.index("--camera")], "--calibration", str(folder / "calib.txt")]


POSES = [
    Row("trajectory, the quaternion before the position by the head line",
        with_poses("t.txt", turned_first, headed("# stamp qx qy qz qw tx ty tz")), "told", "x y z w by the head line",
        true_poses),
    Row("trajectory of EuRoC with seventeen columns", with_poses("data.csv", of_euroc, headed(EUROC_HEAD, ",")), "told",
        "w x y z by the head line", true_poses),
    Row("trajectory in nanoseconds, two poses a frame",
        at_25_hz(with_poses("t.txt", twice_as_often, np.savetxt)), "told", "stamps are nanoseconds", true_poses),
    Row("trajectory, transposed 4x4 matrices", with_poses("t.npy", transposed, np.save), "refused",
        "is the matrix transposed?"),
    Row("trajectory, a head line with another number of columns",
        with_trajectory("# stamp tx ty tz qw qx qy qz extra", *(f"{i} 0 0 0 1 0 0 0" for i in range(12))), "refused",
        "its head line names 9 columns"),
    Row("trajectory, order of the quaternion not stated",
        with_trajectory(*(f"{i} 0 0 0 0 0 0 1" for i in range(12))), "told", "quaternions are read as x y z w"),
    Row("nerfstudio, transposed matrices", public("nerfstudio", change=transposed_matrices), "refused",
        "is the matrix transposed?"),
]  # fmt: skip
MODELS = [
    Row("COLMAP, images.txt without lines of points", colmap(change=without_lines_of_points), "refused",
        "every picture has two lines"),
    *(Row(f"COLMAP, bytes behind the last entry of {name}.bin", colmap(binary=True, change=longer(name)), "refused",
          "bytes behind the last entry") for name in ("cameras", "images", "points3D")),
    Row("COLMAP, a text model and a binary model in one folder", colmap(change=both_forms), "told",
        "the text files are read, not the binary ones"),
    Row("points, x y z behind the colours", cloud("ascii", "red green blue z y x"), "right", "", flat_depth),
    Row("points, little-endian", cloud("binary_little_endian"), "right", "", flat_depth),
    Row("points, big-endian", cloud("binary_big_endian"), "right", "", flat_depth),
    Row("points, faces behind the vertices", cloud("ascii", more="element face 2\nproperty list uchar int v\n",
        tail=b"3 0 1 2\n3 1 2 3\n"), "told", "not used: its face", flat_depth),
    Row("points, a property that is not known", cloud("ascii", "x y z lidar_ring"), "told", "unknown here: lidar_ring",
        flat_depth),
    Row("points, the file is not there", public("nerfstudio", with_depth=False, ply_file_path="sparse_pc.ply"), "told",
        "sparse_pc.ply is not there"),
]  # fmt: skip
CALIBRATIONS = [
    Row("calibration, rostopic echo with roi and several messages",
        calibrated("a.yaml", lambda: ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2)), "told", "half a pixel", centred),
    Row("calibration, rostopic echo of two cameras", calibrated("a.yaml", lambda: ROS_ECHO.format(seq=1)
        + ROS_ECHO.format(seq=2).replace("101.0", "103.0")), "refused", "2 documents that differ"),
    Row("calibration, K and D with 4 coefficients", calibrated("a.yaml", lambda: FISHEYE), "told",
        "read as k1 k2 p1 p2"),
    Row("calibration, settings of ORB-SLAM", calibrated("a.yaml", lambda: ORB.format("PinHole", 0.0)), "told",
        "half a pixel", centred),
    Row("calibration, fisheye settings of ORB-SLAM", calibrated("a.yaml", lambda: ORB.format("KannalaBrandt8", 0.1)),
        "refused", "use PinHole or Rectified"),
    Row("calibration, sensor.yaml of EuRoC", calibrated("a.yaml", lambda: EUROC), "told", "half a pixel", centred),
    Row("calibration, calib.txt of KITTI", kitti_pair, "told", "P0 and P1 are read", with_baseline(4.0)),
]  # fmt: skip
SILENT_ROWS = [*POSES, *MODELS, *CALIBRATIONS]
