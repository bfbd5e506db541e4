"""Rows of `inputs_tried.py` about fields that a reader passed over: columns, rows of matrices, lines, models, marks."""

import shutil
import struct
import zlib
from pathlib import Path

import numpy as np
import one_view
import raw_sources
from builders import builder
from depth_folders import recording as with_depth
from depth_folders import true_depth
from input_kinds import (
    MATRIX,
    Row,
    baseline,
    blank,
    calibrated,
    centred,
    close,
    colmap,
    converted,
    depth_files,
    depth_is_true,
    exif,
    first_to_last,
    folder_of,
    frames_changed,
    named,
    pair,
    prepare,
    public,
    raw,
    reworded,
    sides,
    timed,
    trajectory,
    video,
    with_files,
)
from left_inputs import MOVED, moving, squared, true_poses, with_poses
from made_videos import pictures
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from scipy.spatial.transform import Rotation

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.layouts import describe
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
    return Rotation.from_matrix(found[:, :, :3]).as_quat()[:, ["xyzw".index(axis) for axis in order]]


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


def backwards(make):
    return lambda folder: [*make(folder), "--trajectory-direction", "world_to_camera"]


@builder
def longer(raw: Path, name: str) -> None:
    """A binary file with bytes behind its last entry, as another version of its format has."""
    file = raw / f"sparse/0/{name}.bin"
    file.write_bytes(file.read_bytes() + bytes(16))


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
    seen = read_png(folder / "o/depth/000000.png")
    return bool((seen > 0).mean() > 0.2 and np.ptp(seen[seen > 0]) <= 1)


def kitti_pair() -> str:
    across = [100.0, 0, 63.5, -0.4, 0, 101, 47.5, 0, 0, 0, 1, 0]
    own = across[:3] + [0.0] + across[4:]
    text = "\n".join(f"P{k}: {' '.join(map(str, row))}" for k, row in enumerate((own, across)))
    return text + "\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"


POSES = [
    Row("trajectory, the quaternion before the position by the head line",
        with_poses("t.txt", turned_first, headed("# stamp qx qy qz qw tx ty tz")), "told", "x y z w by the head line",
        true_poses),
    Row("trajectory, rotation vectors by the head line",
        with_poses("t.csv", as_vectors, headed("frame,rvec_x,rvec_y,rvec_z,tvec_x,tvec_y,tvec_z", ",")), "told",
        "rotations are vectors in radians by the head line", true_poses),
    Row("trajectory, rotation vectors or angles",
        with_poses("t.csv", as_vectors, headed("frame,rx,ry,rz,tx,ty,tz", ",")), "refused",
        "rx ry rz: angles, or a rotation vector; angles are not read: write quaternions"),
    Row("trajectory, rotation vectors in degrees",
        trajectory(["# stamp tx ty tz rvec0 rvec1 rvec2", *(f"{i} 0 0 {i} 0 90 0" for i in range(12))]), "refused",
        "the rotation vector has length 90; use radians"),
    Row("trajectory of EuRoC with seventeen columns", with_poses("data.csv", of_euroc, headed(EUROC_HEAD, ",")), "told",
        "w x y z by the head line", true_poses),
    Row("trajectory in nanoseconds, two poses a frame",
        at_25_hz(with_poses("t.txt", twice_as_often, np.savetxt)), "told", "stamps are nanoseconds", true_poses),
    Row("trajectory, the wrong direction", backwards(with_poses("t.npy", squared, np.save)), "refused",
        "another reading explains the pictures"),
    Row("trajectory, transposed 4x4 matrices", with_poses("t.npy", transposed, np.save), "refused",
        "is the matrix transposed?"),
    Row("trajectory, a head line with another number of columns",
        trajectory(["# stamp tx ty tz qw qx qy qz extra", *(f"{i} 0 0 0 1 0 0 0" for i in range(12))]), "refused",
        "its head line names 9 columns"),
    Row("trajectory, order of the quaternion not stated",
        trajectory([f"{i} 0 0 0 0 0 0 1" for i in range(12)]), "told", "quaternions are read as x y z w"),
    Row("nerfstudio, transposed matrices", public("nerfstudio", change=frames_changed(
        transform_matrix=lambda frame: np.array(frame["transform_matrix"]).T.tolist())), "refused",
        "is the matrix transposed?"),
]  # fmt: skip
MODELS = [
    Row("COLMAP, images.txt without lines of points", colmap(change=reworded(
        "sparse/0/images.txt", first_to_last(0, step=2))), "refused",
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
        calibrated("a.yaml", ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2)), "told", "half a pixel", centred),
    Row("calibration, rostopic echo of two cameras", calibrated("a.yaml", ROS_ECHO.format(seq=1)
        + ROS_ECHO.format(seq=2).replace("101.0", "103.0")), "refused", "2 documents that differ"),
    Row("calibration, rostopic echo, fisheye",
        calibrated("a.yaml", ROS_ECHO.format(seq=1).replace("plumb_bob", "equidistant")), "refused",
        "distortion_model 'equidistant'"),
    Row("calibration, with --distortion", calibrated("K.txt", MATRIX, "--distortion", "0.1", "0", "0", "0"),
        "refused", "a calibration file states intrinsics and distortion"),
    Row("calibration, K and D with 4 coefficients", calibrated("a.yaml", FISHEYE), "told",
        "read as k1 k2 p1 p2"),
    Row("calibration, settings of ORB-SLAM", calibrated("a.yaml", ORB.format("PinHole", 0.0)), "told",
        "half a pixel", centred),
    Row("calibration, fisheye settings of ORB-SLAM", calibrated("a.yaml", ORB.format("KannalaBrandt8", 0.1)),
        "refused", "use PinHole or Rectified"),
    Row("calibration, sensor.yaml of EuRoC", calibrated("a.yaml", EUROC), "told", "half a pixel", centred),
    Row("calibration, calib.txt of KITTI", calibrated("calib.txt", kitti_pair(), folders=("left",
        "right")), "told", "P0 and P1 are read", baseline(4.0)),
]  # fmt: skip


def chunk(kind: bytes, content: bytes):
    """Every picture with one more chunk of PNG."""

    def change(folder: Path) -> None:
        for file in (folder / "clip").iterdir():
            data = file.read_bytes()
            made = struct.pack(">I", len(content)) + kind + content
            file.write_bytes(data[:33] + made + struct.pack(">I", zlib.crc32(made[4:])) + data[33:])

    return folder_of(pictures(4), change=change)


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


def of_another_kind(folder: Path) -> None:
    for k in range(5):
        (folder / f"clip/{12 + k:04d}.jp2").write_bytes(b"jp2")


@builder
def in_one_file(folder: Path, ending: str) -> list[str]:
    """Depth of a whole clip as one array."""
    words = with_depth(folder, true_depth, "d", "npy")
    stack = np.stack([np.load(file) for file in sorted((folder / "d").iterdir())])
    file = folder / f"clip{ending}"
    np.savez(file, depths=stack) if ending == ".npz" else np.save(file, stack)
    return [str(file) if word == str(folder / "d") else word for word in words]


def with_no_data(path: Path, plane: np.ndarray) -> None:
    """Depth in TIFF whose tag states the number without a meaning."""
    tags = ImageFileDirectory_v2()
    tags[42113], tags.tagtype[42113] = "77", 2
    plane = plane.astype(np.float32)
    plane[:20, :30] = 77
    Image.fromarray(plane).save(path, tiffinfo=tags)


def corner_is_empty(folder: Path) -> bool:
    seen = read_png(folder / "o/depth/000002.png")
    return bool((seen[:19, :29] == 0).all() and (seen > 0).mean() > 0.9)


@builder
def disparity(folder: Path, times: float, *words: str, marked: bool = False) -> list[str]:
    """Disparities of a clip as 16-bit PNG, or with a sign and -16 at pixels without a match, as OpenCV has them."""
    where, given = one_view.clip(folder, lambda i: 1800 / true_depth(i))
    text, file = where / "sequence.toml", read_sequence_file(where)
    text.write_text(text.read_text().replace("baseline = 0.0", "baseline = 4.0"))
    for k, one_file in enumerate(sorted(given.iterdir())):
        pixels = file.camera.fx * 4.0 / true_depth(k)
        stored = np.rint(pixels * times).astype(np.uint16)
        one_file.unlink()
        if marked:
            stored[:2] = -16 & 0xFFFF
            np.save(one_file, stored.astype(np.int16))
        else:
            write_png(one_file.with_suffix(".png"), stored)
    return ["depth", str(where), "--given", str(given), "--kind", "disparity", *words]


def depth_of_disparity(folder: Path) -> bool:
    found = describe(next(folder.glob("*/sequence.toml")).parent).depth
    return found is not None and np.abs(found(2) - true_depth(2))[2:].max() < 1


def marked_video(name: str, mark: str, *words: str, frames=None):
    """A video whose coded pictures (H.264) state a stereo pair."""
    return video(name, frames, *words, options={"x264-params": mark, "qp": "8"})


def mirrored(path: Path) -> None:
    """The matrix of the track of an MP4 mirrors the pictures."""
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 44
    data[place : place + 4] = struct.pack(">i", -65536)
    path.write_bytes(data)


def cropped(path: Path) -> None:
    """PixelCropRight in the place of DisplayUnit in a Matroska file."""
    path.write_bytes(path.read_bytes().replace(b"\x54\xb2\x81\x04", b"\x54\xdd\x81\x10", 1))


SIDE_BY_SIDE = [np.hstack([a, b]) for a, b in zip(pictures(), MOVED)]
STACKED = [np.vstack([a, b]) for a, b in zip(pictures(), MOVED)]
BASELINE = ("--baseline", "4")
PICTURES = [
    Row("pictures, PNG turned by EXIF", chunk(b"eXIf", exif(6)[6:]), "refused", "orientation 6"),
    Row("pictures, PNG of a stereo pair", chunk(b"sTER", b"\1"), "told", "--stereo side_by_side"),
    Row("pictures, PNG of high dynamic range", chunk(b"cICP", bytes([9, 16, 0, 1])), "refused", "high dynamic range"),
    Row("pictures, PNG with other primaries", chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 21000,
        71000, 15000, 6000)), "told", "a colour profile other than sRGB"),
    Row("pictures, PNG with the primaries of sRGB", chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000,
        60000, 15000, 6000)), "right", "", close(pictures(4), 0.01)),
    Row("pictures, PNG with oblong pixels", chunk(b"pHYs", struct.pack(">IIB", 2, 1, 0)), "told", "not square"),
    Row("pictures, PNG with a chunk that is not known", chunk(b"neWc", b"1"), "told", "unknown here: neWc"),
    Row("pictures, several in a JPEG", folder_of(pictures(4), change=converted("jpg", format="MPO", save_all=True,
        append_images=[blank()])), "told", "MPF: further pictures"),
    Row("pictures, Adobe RGB by EXIF", folder_of(pictures(4), change=converted("jpg", exif=exif(space=65535),
        quality=95)), "told", "profile other than sRGB"),
    Row("pictures beside masks, depth, times and a calibration", pair(change=with_files("masks/0.png",
        "depth/0.png", "times.txt", "calib.yaml")), "told",
        "not read: calib.yaml, depth/, masks/; see --masks, --depth, --calibration"),
    Row("pictures, others of a kind that is not read", folder_of(pictures(), change=of_another_kind), "told",
        "not read: 5 files .jp2"),
    Row("pictures named by their seconds", named(lambda k: f"{1305031102 + k * k / 10:.6f}.png", pictures(4)), "told",
        "read as seconds", timed([0, 100, 400, 900])),
    Row("COLMAP, points that points3D lacks", colmap(change=reworded("sparse/0/points3D.txt",
        first_to_last(0, -3))), "told", "are not in points3D"),
    Row("nerfstudio, pictures that the file does not list", public("nerfstudio",
        change=lambda raw: shutil.copy(raw / "images/frame_00000.png", raw / "images/frame_00099.png")), "told",
        "not listed in transforms.json and are left out"),
    Row("TUM, trajectory and settings of ORB-SLAM", raw(raw_sources.tum, change=of_orb_slam), "told",
        "poses of CameraTrajectory.txt",
        lambda folder: np.isclose(read_sequence_file(folder / "o").camera.cx, 32)),
    Row("COLMAP, masks beside it", colmap(change=with_files("masks/frame0000.png")), "told",
        "not read: masks/; see --masks"),
    Row("COLMAP, rigs and frames of its new versions", colmap(change=with_files("sparse/0/rigs.txt",
        "sparse/0/frames.txt")), "right", ""),
    Row("EndoNeRF, masks in gt_masks alone", public_endonerf("gt_masks/0.png"), "told", "not read: gt_masks/"),
    Row("EndoNeRF, a second pose file", public_endonerf("pose_bounds.npy"), "told", "not read: pose_bounds.npy"),
    Row("nerfstudio, depth and masks that the file does not name",
        public("nerfstudio", with_depth=False, change=with_files("sam/0.png")), "told",
        "not read: depth/, sam/"),
]  # fmt: skip
DEPTHS = [
    Row("depth, one npz for the clip", in_one_file(".npz"), "told", "clip.npz: --pairing order", depth_is_true),
    Row("depth, one npy for the clip", in_one_file(".npy"), "told", "clip.npy: --pairing order", depth_is_true),
    Row("depth, one npz for each frame", depth_files(lambda path, plane: np.savez_compressed(path,
        depth=plane.astype(np.float32)), ".npz"), "right", "", depth_is_true),
    Row("depth, TIFF with a number that means none", depth_files(with_no_data, ".tif"), "right", "", corner_is_empty),
    Row("disparity times 256", disparity(256), "refused", "--unit-scale 0.00390625"),
    Row("disparity times 16 of OpenCV", disparity(16), "refused", "--unit-scale 0.0625"),
    Row("disparity times 16 of OpenCV, of far tissue", disparity(16 / 3, marked=True), "refused",
        "-16 marks pixels without a match; disparities times 16"),
    Row("disparity times 16 of OpenCV, --unit-scale", disparity(16, "--unit-scale", "0.0625", marked=True), "right", "",
        depth_of_disparity),
    Row("disparity times 256, --unit-scale", disparity(256, "--unit-scale", "0.00390625"), "right", "",
        depth_of_disparity),
]  # fmt: skip
MARKED = [
    Row("video, side by side by a mark of H.264", marked_video("a.mp4", "frame-packing=3", *BASELINE,
        frames=SIDE_BY_SIDE), "told", "states stereo pairs side by side: read as such", sides(pictures(), MOVED)),
    Row("video, stacked by a mark of H.264", marked_video("a.mkv", "frame-packing=4", *BASELINE, frames=STACKED),
        "told", "states stereo pairs stacked: read as such", sides(pictures(), MOVED)),
    Row("video, a mark of a pair, --stereo none", marked_video("a.mp4", "frame-packing=3", "--stereo", "none",
        frames=SIDE_BY_SIDE), "told", "--stereo none overrides it"),
    Row("video, a mark of alternating pictures", marked_video("a.mp4", "frame-packing=5"), "refused",
        "stereo pairs in alternating pictures"),
    Row("video, mirrored", video("a.mp4", change=mirrored), "refused", "are shown mirrored"),
    Row("video, mirrored, --orientation stored", video("a.mp4", None, "--orientation", "stored", change=mirrored),
        "told", "states mirrored pictures: used as stored", close(pictures())),
    Row("video, AVI with pictures that refer to later ones", video("a.avi", pictures(20), options={"bf": "2"}), "told",
        "evenly spaced, 25 a second", lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, 25)),
    Row("video, a crop of Matroska", video("a.mkv", change=cropped), "refused",
        "PixelCropRight = "),
]  # fmt: skip
SILENT_ROWS = [*POSES, *MODELS, *CALIBRATIONS, *PICTURES, *DEPTHS, *MARKED]
