"""Rows of `inputs_tried.py` about trajectories: columns, directions, units, frames without a pose."""

from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import EUROC_HEAD, lens_of, matrices, moving, prepare, quaternions, squared, with_file
from input_rows import refused, right, told, true_poses
from scipy.spatial.transform import Rotation

from endotsr.clips.sequences.sequence_file import read_sequence_file


def trajectory(lines: list[str] | bytes, *words: str):
    """Pictures with a trajectory in a text file."""
    return with_file("--trajectory", "t.txt", lines if isinstance(lines, bytes) else "\n".join(lines), *words)


# Poses of four of twelve frames, as the key frames of ORB-SLAM.
KEY_FRAMES = [f"{k / 25:.6f} {k / 1000} 0 0 0 0 0 1" for k in (0, 3, 7, 11)]


def llff(folder: Path) -> None:
    """The axes that LLFF's own tool writes: down, right, backward."""
    moving(folder)
    rows = np.load(folder / "clip/poses_bounds.npy")
    for row in rows:
        matrix = row[:15].reshape(3, 5)
        right, up, back = matrix[:, :3].T.copy()
        matrix[:, 0], matrix[:, 1], matrix[:, 2] = -up, right, back
    np.save(folder / "clip/poses_bounds.npy", rows)


@builder
def llff_prepared(folder: Path, *words: str) -> list[str]:
    llff(folder)
    return prepare("clip", *words, camera=())(folder)


def llff_trained(folder: Path) -> list[str]:
    llff(folder)
    return ["train", str(folder / "clip"), "--out", str(folder / "run"), "--iterations", "2", "-q"]


@builder
def with_poses(folder: Path, name: str, rows, write_rows, *more: str) -> list[str]:
    """Pictures and depth of a moving scope with its trajectory in another form."""
    write_rows(folder / name, rows(matrices(folder)))
    clip = folder / "clip"
    lens = ("--camera", *map(str, lens_of(clip)))
    words = ["--trajectory", str(folder / name), "--trajectory-unit", "mm", "--depth", str(clip / "depth"), *more]
    return prepare("clip/images", *words, camera=lens)(folder)


def kitti(found: np.ndarray) -> np.ndarray:
    return found.reshape(len(found), 12)


def headed(head: str, delimiter: str = " "):
    return lambda path, rows: np.savetxt(path, rows, delimiter=delimiter, header=head, comments="")


def turned_first(found: np.ndarray) -> np.ndarray:
    """The quaternion before the position."""
    return np.column_stack([np.arange(len(found)), quaternions(found), found[:, :, 3]])


def of_unity(found: np.ndarray) -> np.ndarray:
    """Position, quaternion and seconds, as EndoSLAM has them."""
    return np.column_stack([found[:, :, 3], quaternions(found), np.arange(len(found)) / 30])


def as_vectors(found: np.ndarray) -> np.ndarray:
    """The rotation as a vector in radians before the position, as solvePnP of OpenCV gives it."""
    vectors = Rotation.from_matrix(found[:, :, :3]).as_rotvec()
    return np.column_stack([np.arange(len(found)), vectors, found[:, :, 3]])


def of_euroc(found: np.ndarray) -> np.ndarray:
    """Seventeen columns: nanoseconds, position, w x y z, velocity and two biases."""
    stamps = 1403636579763555584 + 4e7 * np.arange(len(found))
    return np.column_stack([stamps, found[:, :, 3], quaternions(found, "wxyz"), np.zeros((len(found), 9))])


def twice_as_often(found: np.ndarray) -> np.ndarray:
    """Nanoseconds, and a second pose between two frames."""
    both = np.repeat(found, 2, axis=0)
    stamps = 1403636579763555584 + 2e7 * np.arange(len(both))
    return np.column_stack([stamps, both[:, :, 3], quaternions(both)])


EULER = ["t,x,y,z,roll,pitch,yaw", *(f"{i / 25},{i},0,0,0,0,90" for i in range(12))]
LOST = [f"{i / 25:.2f} {'nan ' * 7 if i == 4 else '0 0 0 0 0 0 1'}" for i in range(12)]
ROTATED = [f"{i:04d}.png,{0.001 * i},0,0,0.1,0.2,0.3" for i in range(12)]


def pose_lines(separator: str = " ", factor: float = 1.0, sign: int = 1, end: str = "", quote: str = "") -> list[str]:
    """A camera that moves by 1 mm a frame, positions times a factor; every second quaternion with this sign."""
    rows = [[0.04 * i, factor * 0.001 * i, 0.0, 0.0, 0.0, 0.0, 0.0, sign**i] for i in range(12)]
    return [separator.join(f"{quote}{value:.6f}{quote}" for value in row) + end for row in rows]


FIELDS = [f"position.{axis}" for axis in "xyz"] + [f"orientation.{axis}" for axis in "xyzw"]
ROS = [",".join(["%time,field.header.seq,field.header.frame_id", *(f"field.pose.pose.{name}" for name in FIELDS)])]
ROS += [f"{int(1e9 * (1.7e9 + 0.04 * i))},{i},map,{line.partition(',')[2]}" for i, line in enumerate(pose_lines(","))]


def moves_by_mm(folder: Path) -> bool:
    """The written camera moves by 1 mm from frame to frame."""
    found = np.reshape(read_sequence_file(folder / "o").poses.matrices, (12, -1, 4))
    return np.allclose(np.linalg.norm(found[:, :3, 3], axis=1), np.arange(12), atol=1e-3)


LINES = pose_lines()
STILL = [f"{i} 0 0 0 0 0 0 1" for i in range(12)]
POSE_ROWS = [
    refused("LLFF, axes of its own tool", llff_prepared(), "prepare --trajectory-axes llff"),
    refused("LLFF, axes of its own tool, training", llff_trained, "prepare --trajectory-axes llff"),
    right("LLFF, --trajectory-axes llff", llff_prepared("--trajectory-axes", "llff"), true_poses),
    refused("trajectory of more poses than frames", trajectory([f"{i / 25:.2f} 0 0 0 0 0 0 1" for i in range(15)]),
        "15 poses with times for 12 frames"),
    refused("trajectory of fewer poses than frames", trajectory(STILL[:9]), "3 of 12 frames have no pose"),
    refused("trajectory of key frames", trajectory(KEY_FRAMES, "--source-rate", "25"), "8 of 12 frames have no pose"),
    told("trajectory of key frames, --gaps fill", trajectory(KEY_FRAMES, "--source-rate", "25", "--gaps", "fill"),
        "poses are interpolated"),
    told("trajectory of KITTI", with_poses("kitti.txt", kitti, np.savetxt), "positions in mm", true_poses),
    told("trajectory, npy of 4x4 matrices", with_poses("poses.npy", squared, np.save), "positions in mm", true_poses),
    told("trajectory of EuRoC, w x y z by a head line without a mark", with_poses("data.csv",
        lambda found: of_euroc(found)[:, :8], headed("timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", ",")), "positions in mm",
        true_poses),
    refused("trajectory of KITTI, a pose missing", with_poses("kitti.txt", lambda m: kitti(m)[1:], np.savetxt),
        "13 poses without stamps for 14 frames"),
    told("trajectory, the quaternion before the position by the head line", with_poses("t.txt", turned_first,
        headed("# stamp qx qy qz qw tx ty tz")), "x y z w by the head line", true_poses),
    told("trajectory, rotation vectors by the head line", with_poses("t.csv", as_vectors,
        headed("frame,rvec_x,rvec_y,rvec_z,tvec_x,tvec_y,tvec_z", ",")),
        "rotations are vectors in radians by the head line", true_poses),
    refused("trajectory, rotation vectors or angles", with_poses("t.csv", as_vectors, headed("frame,rx,ry,rz,tx,ty,tz",
        ",")), "rx ry rz: angles, or a rotation vector; angles are not read: write quaternions"),
    told("trajectory, a quaternion named rX rY rZ rW", with_poses("t.csv", of_unity,
        headed("tX,tY,tZ,rX,rY,rZ,rW,time", ",")), "quaternions are x y z w by the head line", true_poses),
    refused("trajectory, rotation vectors in degrees", trajectory(["# stamp tx ty tz rvec0 rvec1 rvec2",
        *(f"{i} 0 0 {i} 0 90 0" for i in range(12))]), "the rotation vector has length 90; use radians"),
    told("trajectory of EuRoC with seventeen columns", with_poses("data.csv", of_euroc, headed(EUROC_HEAD, ",")),
        "w x y z by the head line", true_poses),
    told("trajectory in nanoseconds, two poses a frame", with_poses("t.txt", twice_as_often, np.savetxt,
        "--source-rate", "25"), "stamps are nanoseconds", true_poses),
    refused("trajectory, the wrong direction", with_poses("t.npy", squared, np.save, "--trajectory-direction",
        "world_to_camera"), "another reading explains the pictures"),
    refused("trajectory, transposed 4x4 matrices", with_poses("t.npy", lambda found: squared(found).transpose(0, 2, 1),
        np.save), "is the matrix transposed?"),
    refused("trajectory, a head line with another number of columns", trajectory(["# stamp tx ty tz qw qx qy qz extra",
        *(f"{i} 0 0 0 1 0 0 0" for i in range(12))]), "its head line names 9 columns"),
    refused("trajectory with decimal commas", trajectory([f"0,{4 * i:02d} 0,001 0 0 0 0 0 1" for i in range(12)]),
        "write decimal points"),
    told("trajectory whose stamps go back", trajectory(LINES[::-1]), "line 2: stamps go back: the poses are sorted"),
    refused("trajectory with a stamp twice", trajectory([*LINES[:4], LINES[3], *LINES[4:]]), "twice"),
    refused("trajectory with a quaternion of zeros", trajectory([*LINES[:11], "0.44 0 0 0 0 0 0 0"]), "quaternion"),
    told("trajectory with a byte order mark and CRLF", trajectory(("\ufeff" + "\r\n".join(LINES)).encode(),
        "--source-rate", "25"), "one pose per frame"),
    refused("trajectory in UTF-16", trajectory("\n".join(LINES).encode("utf-16")), "not UTF-8 text"),
    refused("trajectory with angles", trajectory(EULER), "write quaternions"),
    told("trajectory, matrices in brackets", trajectory([str(np.eye(4).tolist())] * 12), "stamps are frame numbers"),
    refused("trajectory, a lost frame as nan", trajectory(LOST), "line 5: use 8 finite numbers"),
    told("trajectory, rostopic echo -p", trajectory(ROS), "by the head line", moves_by_mm),
    told("trajectory, cells in quotation marks", trajectory(pose_lines(",", quote='"')), "x y z w", moves_by_mm),
    told("trajectory, a comment behind each line", trajectory(pose_lines("\t", end="  # tracked")), "x y z w",
        moves_by_mm),
    told("trajectory, quaternions of either sign", trajectory(pose_lines(sign=-1)), "x y z w", moves_by_mm),
    told("trajectory of a spreadsheet, names with spaces", trajectory(["Time;Position X [m];Position Y [m];"
        "Position Z [m];Quat X;Quat Y;Quat Z;Quat W", *pose_lines(";")]), "by the head line", moves_by_mm),
    refused("trajectory in millimetres by the head line", trajectory(["stamp,tx [mm],ty [mm],tz [mm],qx,qy,qz,qw",
        *pose_lines(",", 1e3)]), "states positions in mm, and they are read in m; use --trajectory-unit mm"),
    told("trajectory in millimetres by the head line, the remedy", trajectory(["# stamp tx_mm ty_mm tz_mm qx qy qz qw",
        *pose_lines(factor=1e3)], "--trajectory-unit", "mm"), "positions in mm", moves_by_mm),
    told("trajectory, one pose for all frames", trajectory(STILL),
        "all 12 poses are the same: the camera is read as one that stands still"),
    refused("trajectory, times of a calendar", trajectory([f"2026-11-30T12:00:{i:02d}Z 0 0 0 0 0 0 1" for i in
        range(12)]), "'2026-11-30T12:00:00Z' is no number"),
    refused("trajectory of photogrammetry, angles", trajectory(["#name,x,y,alt,heading,pitch,roll", *ROTATED]),
        "'0000.png' is no number"),
    *(refused(f"trajectory, {name}", with_file("--trajectory", name, b"PK\3\4"), said) for name, said in (("t.json",
        "JSON is not read here"), ("t.xlsx", "save its sheet as CSV"), ("t.npz", "numpy.save"), ("t.bag",
        "rostopic echo -p"))),
]  # fmt: skip
