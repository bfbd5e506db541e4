"""Good files of recordings for the fuzzing, and their readers: pictures, videos, calibrations, trajectories, models."""

import io
import struct
import tempfile
from functools import cache
from pathlib import Path

import common_folder
import cv2
import field_formats
import made_videos
import numpy as np
import raw_sources
import yaml
from PIL import Image
from scipy.io import savemat

from endotsr.clips.formats.calibrations import calibrated
from endotsr.clips.formats.colmap_model import read_model
from endotsr.clips.formats.film_file import write_video
from endotsr.clips.formats.time_lists import nanosecond_list, picture_times
from endotsr.clips.formats.trajectory import filled, poses_of_frames
from endotsr.clips.formats.trajectory import read_trajectory as read_poses_of
from endotsr.clips.formats.video_file import video_facts, video_pictures
from endotsr.clips.sequences.depth_files import depth_plane, read_plane
from endotsr.clips.sequences.layouts import points, tum
from endotsr.clips.sequences.sequence_file import read_poses
from endotsr.clips.sequences.sequence_file import read_sequence_file as read_file


@cache
def jpeg_seeds() -> list[bytes]:
    """Colour and grey pictures of two qualities, one of them progressive."""
    rng = np.random.default_rng(0)
    colour, grey = rng.integers(0, 255, (17, 23, 3), np.uint8), rng.integers(0, 255, (16, 9), np.uint8)
    ways = ((colour, [cv2.IMWRITE_JPEG_QUALITY, 90]), (grey, []), (colour, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]))
    return [cv2.imencode(".jpg", pixels, way)[1].tobytes() for pixels, way in ways]


@cache
def tiff_seeds() -> list[bytes]:
    """Planes of 8 and 16 bits and of real numbers."""
    planes = [np.arange(63, dtype=kind).reshape(7, 9) for kind in (np.uint8, np.uint16, np.float32)]
    return [cv2.imencode(".tiff", plane)[1].tobytes() for plane in planes]


WAYS = {  # to store a picture: without and with loss, packed, with a header of the extended form
    "bmp": [{}], "webp": [{}, {"lossless": True}, {"icc_profile": b"x" * 40}],
    "tiff": [{"compression": way} for way in (None, "tiff_lzw", "tiff_adobe_deflate", "packbits")],
}  # fmt: skip


def pillow_seeds(kind: str) -> list[bytes]:
    """A picture in colour, in grey and with a palette, each stored in every way."""
    picture, found = Image.fromarray(np.random.default_rng(0).integers(0, 255, (9, 13, 3), np.uint8)), []
    for way in WAYS[kind]:
        for mode in ("RGB", "L", "P"):
            out = io.BytesIO()
            picture.convert(mode).save(out, kind, **way)
            found.append(out.getvalue())
    return found


def pfm_seeds() -> list[bytes]:
    return [b"Pf\n5 4\n-1.0\n" + np.arange(20, dtype="<f4").tobytes()]


@cache
def video_seeds() -> list[bytes]:
    """Three pictures as .mp4, without loss and with."""
    pictures = list(np.random.default_rng(0).integers(0, 255, (3, 16, 24, 3), np.uint8))
    with tempfile.TemporaryDirectory() as scratch:
        files = [Path(scratch) / name for name in ("a.mp4", "b.mp4")]
        for file, lossless in zip(files, (True, False)):
            write_video(file, pictures, 5.0, lossless)
        return [file.read_bytes() for file in files]


@cache
def stream_seeds(ending: str) -> list[bytes]:
    """Three pictures as .avi, .ts, .mpg or .mkv, in two codecs."""
    pictures = np.random.default_rng(0).integers(0, 255, (3, 32, 48, 3), np.uint8)
    codecs = {"avi": ("mjpeg", "mpeg4"), "mkv": ("ffv1", "libx264")}.get(ending, ("mpeg2video", "mpeg1video"))
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for codec in codecs:
            layout = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            file = made_videos.write(Path(scratch) / f"{codec}.{ending}", list(pictures), codec, layout=layout)
            found.append(file.read_bytes())
    return found


def read_video(path: Path) -> object:
    """As `prepare` does, of at most three pictures."""
    return list(video_pictures(path, list(range(min(video_facts(path).count, 3)))))


def read_depth(path: Path) -> object:
    return depth_plane(read_plane(path), 0.1, path)


@cache
def sequence_file_seeds() -> list[bytes]:
    """sequence.toml with everything that it can hold."""
    with tempfile.TemporaryDirectory() as scratch:
        common_folder.written(Path(scratch), poses=common_folder.moving(), frame_rate=25.0, source="a clip")
        return [(Path(scratch) / "sequence.toml").read_bytes()]


def read_sequence_file(path: Path) -> object:
    found = read_file(path.parent)
    return found.camera.intrinsics(path), read_poses(found, path)


def rig_seeds() -> list[bytes]:
    """A stereo calibration."""
    return [raw_sources.ini((0.01,) * 8, (0.01,) * 8, translation=(-4.2, 0.0, 0.1)).encode()]


def _storage(kind: str) -> bytes:
    """A pair as OpenCV stores it; kind: ".yml" or ".xml"."""
    out = cv2.FileStorage(f"pair{kind}", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for name in ("M1", "M2"):
        out.write(name, np.array([[60.0, 0, 31], [0, 61, 24], [0, 0, 1]]))
    for name in ("D1", "D2"):
        out.write(name, np.array([[0.1, 0.01, 0.0, 0.0]]))
    out.write("R", np.eye(3))
    out.write("T", np.array([[-4.2], [0.0], [0.1]]))
    out.write("image_width", 64)
    out.write("image_height", 48)
    return out.releaseAndGetString().encode()


@cache
def yaml_seeds() -> list[bytes]:
    """A pair of OpenCV, a camera of ROS as `rostopic echo` prints it, a chain of Kalibr, and aliases."""
    repeated = "k: &k [60.0, 0, 31, 0, 61, 24, 0, 0, 1]\nd: &d [0.1, 0, 0, 0]\ncamera_matrix: {data: *k}\n"
    repeated += "distortion_coefficients: {data: *d}\nimage_width: !!int 64\nimage_height: 48\n"
    plain = (field_formats.ECHO, {"cam0": field_formats.CHAIN, "cam1": field_formats.CHAIN})
    return [_storage(".yml"), *(yaml.safe_dump(keys).encode() for keys in plain), repeated.encode()]


@cache
def storage_seeds() -> list[bytes]:
    """A pair of OpenCV as XML."""
    return [_storage(".xml")]


def read_rig(path: Path) -> object:
    return calibrated(path, 64, 48)


def trajectory_seeds() -> list[bytes]:
    """Poses by time and by number of the frame."""
    lines = [f"{stamp} 0.1 0.2 {k} 0 0 0 1" for k, stamp in enumerate(("1.50", "1.54", "1.58", "1.62"))]
    return ["\n".join(["# a comment", *lines, ""]).encode(), b"0 0 0 0 0 0 0 1\n1 0 0 0 0.6 0 0 0.8\n"]


def read_trajectory(path: Path) -> object:
    poses = poses_of_frames(read_poses_of(path, "m", axes="opengl"), 4, 25.0)[0]
    return filled(poses) if any(pose is not None for pose in poses) else poses


def _mat(variables: dict, packed: bool) -> bytes:
    out = io.BytesIO()
    savemat(out, variables, do_compression=packed)
    return out.getvalue()


@cache
def matlab_seeds() -> list[bytes]:
    """One camera and two of MATLAB, and the variables of Bouguet's toolbox; packed and not."""
    camera, pair = {"cameraParams": field_formats.MAT_CAMERA}, {"stereoParams": field_formats.MAT_PAIR}
    return [_mat(variables, packed) for variables in (camera, pair, field_formats.TOOLBOX) for packed in (False, True)]


@cache
def matlab_depth_seeds() -> list[bytes]:
    """A frame in real and in whole numbers."""
    plane = np.arange(1, 64).reshape(7, 9)
    return [_mat({"depth": plane.astype(kind)}, kind is np.uint16) for kind in (np.float32, np.uint16)]


def times_seeds() -> list[bytes]:
    """Times of four pictures: seconds, nanoseconds by the head line, names and dates."""
    days = "\n".join(f"2011-09-26 13:02:25.{100 + 40 * k}389445" for k in range(4))
    names = "\n".join(f"clip\\{k:04d}.png,{1.3e9 + 0.04 * k:.3f}" for k in range(4))
    return [
        b"0.00e+00\n4.0e-02\n8.0e-02\n1.2e-01\n",
        b"#timestamp [ns]\r\n1403636579763555584\r\n1403636579803555584\r\n1403636579843555584\r\n"
        b"1403636579883555584\r\n",
        f"filename,timestamp\n{names}\n".encode(),
        f"{days}\n".encode(),
    ]


def read_times(path: Path) -> object:
    """As a folder of four pictures does; times that are used ascend and are finite."""
    found = picture_times([path.parent], [path.parent / f"{k:04d}.png" for k in range(4)], None)
    assert found.notes and not any(set(note) & set("\n\r\x1b") for note in found.notes), found.notes
    seconds = found.seconds
    assert seconds is None or (np.isfinite(seconds).all() and (np.diff(seconds) > 0).all()), seconds
    return found


def list_seeds() -> list[bytes]:
    return [b"# timestamp filename\n1.50 rgb/1.50.png\n1.54 rgb/1 54.png\n1.58 rgb/1.58.png\n"]


def read_list(path: Path) -> object:
    found = tum.read_list(path)
    assert all(file.resolve().is_relative_to(path.parent.resolve()) for file in found[1])
    return found


def rows_seeds() -> list[bytes]:
    """The list of a camera of EuRoC."""
    lines = [f"{10**18 + k * 5 * 10**7},{10**18 + k * 5 * 10**7}.png" for k in range(3)]
    return ["\r\n".join(["#timestamp [ns],filename", *lines, ""]).encode()]


def read_rows(path: Path) -> object:
    found = nanosecond_list(path, path.parent, [])
    assert all(row.file.resolve().is_relative_to(path.parent.resolve()) for row in found)
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
    return points.read_cameras(path, [path.parent / "0.png", path.parent / "1.png"])
