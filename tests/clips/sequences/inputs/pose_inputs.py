"""Rows of `inputs_tried.py` about trajectories: columns, directions, units, frames without a pose."""

from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import EUROC_HEAD, Row, folder_of, lens_of, matrices, moving, prepare, quaternions, squared, true_poses
from made_videos import pictures
from scipy.spatial.transform import Rotation

from endotsr.clips.sequences.sequence_file import read_sequence_file


@builder
def trajectory(folder: Path, lines: list[str] | bytes, *words: str) -> list[str]:
    """Pictures with a trajectory in a text file."""
    (folder / "t.txt").write_bytes(lines if isinstance(lines, bytes) else "\n".join(lines).encode())
    return folder_of(pictures(), "--trajectory", str(folder / "t.txt"), *words)(folder)


POSE_LINES = [f"{i} {0.001 * i} 0 0 0 0 0 1" for i in range(15)]
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
def with_poses(folder: Path, name: str, rows, write_rows) -> list[str]:
    """Pictures and depth of a moving scope with its trajectory in another form."""
    write_rows(folder / name, rows(matrices(folder)))
    clip = folder / "clip"
    lens = ("--camera", *map(str, lens_of(clip)))
    words = ["--trajectory", str(folder / name), "--trajectory-unit", "mm", "--depth", str(clip / "depth")]
    return prepare("clip/images", *words, camera=lens)(folder)


def kitti(found: np.ndarray) -> np.ndarray:
    return found.reshape(len(found), 12)


def euroc(found: np.ndarray) -> np.ndarray:
    """Stamp in nanoseconds, position, quaternion w x y z."""
    turns = Rotation.from_matrix(found[:, :, :3]).as_quat()[:, [3, 0, 1, 2]]
    return np.column_stack([1e18 + 4e7 * np.arange(len(found)), found[:, :, 3], turns])


def with_head(path: Path, rows: np.ndarray) -> None:
    np.savetxt(path, rows, delimiter=",", header="timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", comments="")


def headed(head: str, delimiter: str = " "):
    return lambda path, rows: np.savetxt(path, rows, delimiter=delimiter, header=head, comments="")


def turned_first(found: np.ndarray) -> np.ndarray:
    """The quaternion before the position."""
    return np.column_stack([np.arange(len(found)), quaternions(found), found[:, :, 3]])


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


def transposed(found: np.ndarray) -> np.ndarray:
    return squared(found).transpose(0, 2, 1)


def at_25_hz(make):
    return lambda folder: [*make(folder), "--source-rate", "25"]


def backwards(make):
    return lambda folder: [*make(folder), "--trajectory-direction", "world_to_camera"]


EULER = ["t,x,y,z,roll,pitch,yaw", *(f"{i / 25},{i},0,0,0,0,90" for i in range(12))]
LINE = "{} {} 0 0 0 0 0 1"
LINES = [LINE.format(f"{i / 25:.2f}", f"{0.001 * i:.4f}") for i in range(12)]
LOST = [f"{i / 25:.2f} {'nan ' * 7 if i == 4 else '0 0 0 0 0 0 1'}" for i in range(12)]
MM_A_FRAME = [(0.04 * i, 0.001 * i, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) for i in range(12)]  # the camera moves 1 mm a frame
ROS = [
    "%time,field.header.seq,field.header.frame_id,"
    + ",".join(f"field.pose.pose.position.{axis}" for axis in "xyz")
    + ","
    + ",".join(f"field.pose.pose.orientation.{axis}" for axis in "xyzw"),
    *(
        ",".join([str(int(1e9 * (1.7e9 + pose[0]))), str(i), "map", *(f"{value:.6f}" for value in pose[1:])])
        for i, pose in enumerate(MM_A_FRAME)
    ),
]
ROTATED = [f"{i:04d}.png,{0.001 * i},0,0,0.1,0.2,0.3" for i in range(12)]


def pose_lines(separator: str = " ", factor: float = 1.0, sign: int = 1, end: str = "", quote: str = "") -> list[str]:
    """The poses as text, positions times a factor; every second quaternion with this sign."""
    found = []
    for i, (stamp, *rest) in enumerate(MM_A_FRAME):
        turn = [sign**i * value for value in rest[3:]]
        row = [stamp, *(factor * value for value in rest[:3]), *turn]
        found.append(separator.join(f"{quote}{value:.6f}{quote}" for value in row) + end)
    return found


def moves_by_mm(folder: Path) -> bool:
    """The written camera moves by 1 mm from frame to frame."""
    poses = read_sequence_file(folder / "o").poses
    return poses is not None and np.allclose(
        [np.linalg.norm(np.reshape(matrix, (-1, 4))[:3, 3]) for matrix in poses.matrices], np.arange(12), atol=1e-3
    )


@builder
def trajectory_file(folder: Path, name: str, content: bytes = b"PK\3\4") -> list[str]:
    """Pictures with a trajectory in a file of another kind."""
    (folder / name).write_bytes(content)
    return folder_of(pictures(), "--trajectory", str(folder / name))(folder)


POSE_ROWS = [
    Row("LLFF, axes of its own tool", llff_prepared(), "refused", "prepare --trajectory-axes llff"),
    Row("LLFF, axes of its own tool, training", llff_trained, "refused", "prepare --trajectory-axes llff"),
    Row("LLFF, --trajectory-axes llff", llff_prepared("--trajectory-axes", "llff"), "right", "", true_poses),
    Row("trajectory of more poses than frames", trajectory([f"{i / 25:.2f} 0 0 0 0 0 0 1" for i in range(15)]),
        "refused", "15 poses with times for 12 frames"),
    Row("trajectory of fewer poses than frames", trajectory(POSE_LINES[:9]), "refused", "3 of 12 frames have no pose"),
    Row("trajectory that is no number", trajectory([*POSE_LINES[:3], "3 nan 0 0 0 0 0 1"]), "refused", "line 4"),
    Row("trajectory of key frames", trajectory(KEY_FRAMES, "--source-rate", "25"), "refused",
        "8 of 12 frames have no pose"),
    Row("trajectory of key frames, --gaps fill", trajectory(KEY_FRAMES, "--source-rate", "25", "--gaps", "fill"),
        "told", "poses are interpolated"),
    Row("trajectory of KITTI", with_poses("kitti.txt", kitti, np.savetxt), "told", "positions in mm", true_poses),
    Row("trajectory, npy of 4x4 matrices", with_poses("poses.npy", squared, np.save), "told", "positions in mm",
        true_poses),
    Row("trajectory of EuRoC, w x y z by a head line without a mark", with_poses("data.csv", euroc, with_head), "told",
        "positions in mm", true_poses),
    Row("trajectory of KITTI, a pose missing", with_poses("kitti.txt", lambda m: kitti(m)[1:], np.savetxt), "refused",
        "13 poses without stamps for 14 frames"),
    Row("trajectory, the quaternion before the position by the head line", with_poses("t.txt", turned_first,
        headed("# stamp qx qy qz qw tx ty tz")), "told", "x y z w by the head line", true_poses),
    Row("trajectory, rotation vectors by the head line", with_poses("t.csv", as_vectors,
        headed("frame,rvec_x,rvec_y,rvec_z,tvec_x,tvec_y,tvec_z", ",")), "told",
        "rotations are vectors in radians by the head line", true_poses),
    Row("trajectory, rotation vectors or angles", with_poses("t.csv", as_vectors, headed("frame,rx,ry,rz,tx,ty,tz",
        ",")), "refused", "rx ry rz: angles, or a rotation vector; angles are not read: write quaternions"),
    Row("trajectory, rotation vectors in degrees", trajectory(["# stamp tx ty tz rvec0 rvec1 rvec2",
        *(f"{i} 0 0 {i} 0 90 0" for i in range(12))]), "refused", "the rotation vector has length 90; use radians"),
    Row("trajectory of EuRoC with seventeen columns", with_poses("data.csv", of_euroc, headed(EUROC_HEAD, ",")), "told",
        "w x y z by the head line", true_poses),
    Row("trajectory in nanoseconds, two poses a frame", at_25_hz(with_poses("t.txt", twice_as_often, np.savetxt)),
        "told", "stamps are nanoseconds", true_poses),
    Row("trajectory, the wrong direction", backwards(with_poses("t.npy", squared, np.save)), "refused",
        "another reading explains the pictures"),
    Row("trajectory, transposed 4x4 matrices", with_poses("t.npy", transposed, np.save), "refused",
        "is the matrix transposed?"),
    Row("trajectory, a head line with another number of columns", trajectory(["# stamp tx ty tz qw qx qy qz extra",
        *(f"{i} 0 0 0 1 0 0 0" for i in range(12))]), "refused", "its head line names 9 columns"),
    Row("trajectory, order of the quaternion not stated", trajectory([f"{i} 0 0 0 0 0 0 1" for i in range(12)]), "told",
        "quaternions are read as x y z w"),
    Row("trajectory with decimal commas", trajectory([line.replace(".", ",") for line in LINES]), "refused",
        "write decimal points"),
    Row("trajectory with semicolons", trajectory([line.replace(" ", ";") for line in LINES]), "told",
        "one pose per frame"),
    Row("trajectory whose stamps go back", trajectory(LINES[::-1]), "told",
        "line 2: stamps go back: the poses are sorted"),
    Row("trajectory with a stamp twice", trajectory([*LINES[:4], LINES[3], *LINES[4:]]), "refused", "twice"),
    Row("trajectory with a quaternion of zeros", trajectory([*LINES[:11], "0.44 0 0 0 0 0 0 0"]), "refused",
        "quaternion"),
    Row("trajectory with a byte order mark and CRLF", trajectory(("\ufeff" + "\r\n".join(LINES)).encode(),
        "--source-rate", "25"), "told", "one pose per frame"),
    Row("trajectory in UTF-16", trajectory("\n".join(LINES).encode("utf-16")), "refused", "not UTF-8 text"),
    Row("trajectory with angles", trajectory(EULER), "refused", "write quaternions"),
    Row("trajectory, matrices in brackets", trajectory([str(np.eye(4).tolist())] * 12), "told",
        "stamps are frame numbers"),
    Row("trajectory, a lost frame as nan", trajectory(LOST), "refused", "line 5: use 8 finite numbers"),
    Row("trajectory, rostopic echo -p", trajectory(ROS), "told", "by the head line", moves_by_mm),
    Row("trajectory, cells in quotation marks", trajectory(pose_lines(",", quote='"')), "told", "x y z w", moves_by_mm),
    Row("trajectory, a comment behind each line", trajectory(pose_lines("\t", end="  # tracked")), "told", "x y z w",
        moves_by_mm),
    Row("trajectory, quaternions of either sign", trajectory(pose_lines(sign=-1)), "told", "x y z w", moves_by_mm),
    Row("trajectory of a spreadsheet, names with spaces", trajectory(["Time;Position X [m];Position Y [m];"
        "Position Z [m];Quat X;Quat Y;Quat Z;Quat W", *pose_lines(";")]), "told", "by the head line", moves_by_mm),
    Row("trajectory in millimetres by the head line", trajectory(["stamp,tx [mm],ty [mm],tz [mm],qx,qy,qz,qw",
        *pose_lines(",", 1e3)]), "refused", "states positions in mm, and they are read in m; use --trajectory-unit mm"),
    Row("trajectory in millimetres by the head line, without brackets",
        trajectory(["stamp tx_mm ty_mm tz_mm qx qy qz" " qw", *pose_lines(factor=1e3)]), "refused",
        "use --trajectory-unit mm"),
    Row("trajectory in millimetres by the head line, the remedy", trajectory(["# stamp tx_mm ty_mm tz_mm qx qy qz qw",
        *pose_lines(factor=1e3)], "--trajectory-unit", "mm"), "told", "positions in mm", moves_by_mm),
    Row("trajectory, one pose for all frames", trajectory([f"{i} 0 0 0 0 0 0 1" for i in range(12)]), "told",
        "all 12 poses are the same: the camera is read as one that stands still"),
    Row("trajectory, times of a calendar", trajectory([f"2026-11-30T12:00:{i:02d}Z 0 0 0 0 0 0 1" for i in range(12)]),
        "refused", "'2026-11-30T12:00:00Z' is no number"),
    Row("trajectory, names of pictures", trajectory([f"{i:04d}.png 0 0 0 0 0 0 1" for i in range(12)]), "refused",
        "'0000.png' is no number"),
    Row("trajectory of photogrammetry, angles", trajectory(["#name,x,y,alt,heading,pitch,roll", *ROTATED]), "refused",
        "'0000.png' is no number"),
    *(Row(f"trajectory, {name}", trajectory_file(name), "refused", said) for name, said in (("t.json",
        "JSON is not read here"), ("t.xlsx", "save its sheet as CSV"), ("t.npz", "numpy.save"), ("t.bag",
        "rostopic echo -p"))),
]  # fmt: skip
