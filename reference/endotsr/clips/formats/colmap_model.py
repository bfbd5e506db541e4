"""COLMAP models, text or binary: cameras, images with their poses, and points.

In: a folder with cameras, images and points3D (.txt or .bin). Out: a `ColmapModel`. COLMAP has the conventions of this
project: world-to-camera, OpenCV axes, first pixel centre at (0.5, 0.5). Quaternions are w x y z.
"""

import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics, checked_intrinsics
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.files import read_bytes, read_text
from endotsr.untrusted.names import choice, counted

LARGEST_FILE = 1 << 31  # bytes of images.bin: 24 for an observation, enough for more than eighty million

# Name -> (number in binary files, parameter indices of fx fy cx cy and of the distortion k1 k2 p1 p2 ...).
MODELS: dict[str, tuple[int, tuple[int, int, int, int], tuple[int | None, ...]]] = {
    "SIMPLE_PINHOLE": (0, (0, 0, 1, 2), ()),
    "PINHOLE": (1, (0, 1, 2, 3), ()),
    "SIMPLE_RADIAL": (2, (0, 0, 1, 2), (3, None, None, None)),
    "RADIAL": (3, (0, 0, 1, 2), (3, 4, None, None)),
    "OPENCV": (4, (0, 1, 2, 3), (4, 5, 6, 7)),
    "FULL_OPENCV": (6, (0, 1, 2, 3), (4, 5, 6, 7, 8, 9, 10, 11)),
}
NUMBERS = {number: name for name, (number, _, _) in MODELS.items()}
PARAMETERS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8, "FULL_OPENCV": 12}


class ModelImage(NamedTuple):
    """One registered picture."""

    name: str
    camera: int
    pose: CameraPose
    points: NDArray[np.int64]  # ids of the visible points


class ColmapModel(NamedTuple):
    """A whole model."""

    cameras: dict[int, Intrinsics]
    images: list[ModelImage]  # by name
    points: dict[int, FloatArray]  # id -> (3,)


def registered_count(folder: Path) -> int:
    """The number of registered pictures of a model. Raises InputError for a missing or damaged file."""
    if (folder / "cameras.txt").exists():
        return len(_image_lines(_found(folder / "images.txt")))
    return _Bytes(_found(folder / "images.bin")).count(64)


def read_model(folder: Path) -> ColmapModel:
    """The model in a folder. Text files take precedence over binary files; points3D may be missing.

    Raises:  InputError naming the file, and the line or entry that violates the format.
    """
    text = (folder / "cameras.txt").exists()
    ending = ".txt" if text else ".bin"
    seen, cloud = _found(folder / f"images{ending}"), folder / f"points3D{ending}"
    if text:
        cameras, images = _cameras_text(folder / "cameras.txt"), _images_text(seen)
        points = _points_text(cloud) if cloud.exists() else {}
    else:
        cameras, images = _cameras_binary(folder / "cameras.bin"), _images_binary(seen)
        points = _points_binary(cloud) if cloud.exists() else {}
    for image in images:
        if image.camera not in cameras:
            raise InputError(f"{folder}: image {image.name}: camera {image.camera} is not in cameras{ending}")
    return ColmapModel(cameras, sorted(images, key=lambda image: image.name), points)


def _intrinsics(name: str, width: int, height: int, values: list[float], where: str) -> Intrinsics:
    if name not in MODELS:
        raise InputError(f"{where}: camera model {name}: use {choice(MODELS)}")
    if len(values) != PARAMETERS[name]:
        raise InputError(f"{where}: {len(values)} parameters; {name} has {PARAMETERS[name]}")
    _, (fx, fy, cx, cy), places = MODELS[name]
    distortion = tuple(0.0 if place is None else values[place] for place in places)
    intrinsics = Intrinsics(
        values[fx], values[fy], values[cx], values[cy], width, height, distortion if any(distortion) else ()
    )
    return checked_intrinsics(intrinsics, where)


def _pose(values: list[float] | FloatArray, where: str) -> CameraPose:
    from scipy.spatial.transform import Rotation

    numbers = np.array(values, np.float64)
    if not np.isfinite(numbers).all() or abs(np.linalg.norm(numbers[:4]) - 1) > 1e-2:
        raise InputError(f"{where}: no pose: use a unit quaternion w x y z and three finite numbers")
    return CameraPose(Rotation.from_quat(numbers[[1, 2, 3, 0]]).as_matrix(), numbers[4:7])


def _found(path: Path) -> Path:
    """The path. Raises InputError if it is no file."""
    if not path.is_file():
        raise InputError(f"{path}: file not found")
    return path


def _lines(path: Path) -> list[tuple[int, str]]:
    lines = read_text(path, LARGEST_FILE).splitlines()
    return [(number, line) for number, line in enumerate(lines, 1) if not line.startswith("#")]


def _cameras_text(path: Path) -> dict[int, Intrinsics]:
    found = {}
    for number, line in _lines(path):
        if line.strip():
            words, where = line.split(), f"{path}: line {number}"
            try:
                key, width, height = int(words[0]), int(words[2]), int(words[3])
                values = [float(word) for word in words[4:]]
            except (ValueError, IndexError):
                raise InputError(f"{where}: use CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS") from None
            found[key] = _intrinsics(words[1], width, height, values, where)
    return found


def _image_lines(path: Path) -> list[tuple[int, str, str]]:
    """Number and text of the line of every picture, and the line of its points."""
    lines = _lines(path)
    while lines and not lines[-1][1].strip() and len(lines) % 2:
        lines.pop()  # trailing empty line; elsewhere, an empty line means no points
    return [(number, line, seen) for (number, line), (_, seen) in zip(lines[::2], [*lines[1::2], (0, "")])]


def _images_text(path: Path) -> list[ModelImage]:
    found = []
    for number, line, seen in _image_lines(path):
        words, where = line.split(maxsplit=9), f"{path}: line {number}"
        try:
            values, camera, name = [float(word) for word in words[1:8]], int(words[8]), words[9].strip()
        except (ValueError, IndexError):
            raise InputError(f"{where}: use IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then points") from None
        points = _visible_points(seen, f"{path}: line {number}: the line below it")
        found.append(ModelImage(name, camera, _pose(values, where), points[points >= 0]))
    return found


def _visible_points(line: str, where: str) -> NDArray[np.int64]:
    """The ids of the points of a picture, -1 for a keypoint without a point.

    Raises:  InputError for another line, such as that of the next picture in a file that leaves out lines of points.
    """
    words = line.split()
    try:
        numbers = np.array(words, np.float64).reshape(-1, 3)
    except ValueError:
        raise InputError(
            f"{where}: use X Y POINT3D_ID of each keypoint, or an empty line: every picture has two lines"
        ) from None
    return numbers[:, 2].astype(np.int64)


def _points_text(path: Path) -> dict[int, FloatArray]:
    found = {}
    for number, line in _lines(path):
        if line.strip():
            words = line.split()
            try:
                point = np.array([float(word) for word in words[1:4]])
                if len(words) < 8 or len(words) % 2 or not np.isfinite(point).all():
                    raise ValueError
                found[int(words[0])] = point
            except (ValueError, IndexError):
                raise InputError(f"{path}: line {number}: use POINT3D_ID X Y Z R G B ERROR TRACK") from None
    return found


class _Bytes:
    """Sequential reader of a binary file."""

    def __init__(self, path: Path) -> None:
        self.path, self.place, self.data = path, 0, read_bytes(path, LARGEST_FILE)

    def take(self, form: str) -> tuple:
        """The next values of a `struct` format, little-endian. Raises InputError at the end of the file."""
        size = struct.calcsize("<" + form)
        if self.place + size > len(self.data):
            raise InputError(
                f"{self.path}: ends after {counted(len(self.data), 'byte')}; {self.place + size} are needed"
            )
        values = struct.unpack_from("<" + form, self.data, self.place)
        self.place += size
        return values

    def count(self, least: int) -> int:
        """A count of entries of at least `least` bytes each, checked against the size of the file."""
        (number,) = self.take("Q")
        if number * least > len(self.data) - self.place:
            raise InputError(f"{self.path}: states {number} entries; the file has {counted(len(self.data), 'byte')}")
        return number

    def end(self) -> None:
        """Raises InputError for bytes behind the last entry."""
        if self.place < len(self.data):
            raise InputError(
                f"{self.path}: {len(self.data) - self.place} bytes behind the last entry: another version of the"
                " format, or a damaged file; export the model again, or as text"
            )

    def name(self) -> str:
        """A zero-terminated string."""
        end = self.data.find(b"\0", self.place)
        if end < 0:
            raise InputError(f"{self.path}: a name has no end")
        text = self.data[self.place : end].decode("utf-8", "replace")
        self.place = end + 1
        return text


def _cameras_binary(path: Path) -> dict[int, Intrinsics]:
    stream, found = _Bytes(path), {}
    for _ in range(stream.count(24)):
        key, model, width, height = stream.take("iiQQ")
        where = f"{path}: camera {key}"
        if model not in NUMBERS:
            raise InputError(f"{where}: camera model number {model}: use {choice(MODELS)}")
        values = list(stream.take(f"{PARAMETERS[NUMBERS[model]]}d"))
        found[key] = _intrinsics(NUMBERS[model], width, height, values, where)
    stream.end()
    return found


def _images_binary(path: Path) -> list[ModelImage]:
    stream, found = _Bytes(path), []
    for _ in range(stream.count(64)):
        key, *values, camera = stream.take("i7di")
        name, seen = stream.name(), stream.count(24)
        points = np.array([stream.take("ddq")[2] for _ in range(seen)], np.int64)
        found.append(ModelImage(name, camera, _pose(values, f"{path}: image {key}"), points[points >= 0]))
    stream.end()
    return found


def _points_binary(path: Path) -> dict[int, FloatArray]:
    stream, found = _Bytes(path), {}
    for _ in range(stream.count(43)):
        key, x, y, z, *_ = stream.take("QdddBBBd")
        stream.take(f"{2 * stream.count(8)}i")
        if not np.isfinite([x, y, z]).all():
            raise InputError(f"{path}: point {key}: use finite numbers")
        found[key] = np.array([x, y, z])
    stream.end()
    return found
