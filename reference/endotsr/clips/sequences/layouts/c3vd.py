"""C3VD: a registered sequence of a colonoscope in a phantom, with rendered depth and poses.

0_color.png ...       1350x1080, omnidirectional camera (Scaramuzza); undistorted here to a pinhole camera
0000_depth.tiff ...   16 bits, 65535 = 100 mm along the optical axis; 0 and 65535 = none
pose.txt              16 numbers per line, the transposed camera-to-world matrix, millimetres, OpenCV axes
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import checked_rotation, intrinsics_of_matrix, inverse_pose, rows_of_motion
from endotsr.clips.formats.files import visible_files
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.opencv.stereo import Maps, remapped
from endotsr.clips.sequences.clip import Clip, Depth, PicturePair, colour_picture
from endotsr.clips.sequences.depth_files import read_plane
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.pairing import matching_files, of_no_or_all_frames
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.files import read_text
from endotsr.untrusted.names import counted

POSES, COLOUR, DEPTH = "pose.txt", "_color.png", "_depth.tif*"
FILES = Inventory(
    "the folder of a sequence of C3VD",
    used={
        "*_color.png": "pictures, 1350x1080",
        "*_depth.tif*": "depth, 65535 = 100 mm; 0 and 65535 mean none",
        "pose.txt": "transposed camera-to-world matrices, millimetres",
    },
    harmless={
        "*_normals.tif* *_flow.tif*": "they follow from depth and poses",
        "*_occlusion.png coverage_mesh.obj": "they show what other frames see of the phantom",
    },
)
STEP, NO_DEPTH = 100.0 / 65535.0, 65535  # mm per step; beyond the depth range
WIDTH, HEIGHT = 1350, 1080
# The camera CF-HQ190L as published by the authors; the first pixel centre is (0, 0).
CENTRE, STRETCH = (
    (678.544839263292, 542.975887548343),
    ((0.999986882249990, 0.00288273829525059), (-0.00296316513429569, 1.0)),
)
POLYNOMIAL = (
    769.243600037458,
    0.0,
    -0.000812770624150226,
    6.25674244578925e-07,
    -1.19662182144280e-09,
)  # of the radius


def recognises(path: Path) -> bool:
    """Whether a path is a folder with poses and numbered pictures."""
    return (path / POSES).is_file() and any(path.glob(f"*{COLOUR}"))


def pinhole_maps() -> Maps:
    """Maps from a pinhole camera of the same size, centre and central focal length to the pictures."""
    focal, radii = POLYNOMIAL[0], np.linspace(0.0, 950.0, 4000)
    angles = np.arctan2(radii, np.polynomial.polynomial.polyval(radii, POLYNOMIAL))
    x, y = np.meshgrid((np.arange(WIDTH) - CENTRE[0]) / focal, (np.arange(HEIGHT) - CENTRE[1]) / focal)
    length = np.hypot(x, y)
    radius = np.interp(np.arctan(length), angles, radii)
    along = np.divide(radius, length, out=np.full_like(length, focal), where=length > 0)
    u, v = x * along, y * along
    columns, rows = (a * u + b * v + middle for (a, b), middle in zip(STRETCH, CENTRE))
    matrix = np.array([[focal, 0, CENTRE[0]], [0, focal, CENTRE[1]], [0, 0, 1]])
    return Maps(columns.astype(np.float32), rows.astype(np.float32), matrix, np.eye(3))


def read_poses(path: Path) -> list[CameraPose | None]:
    """World-to-camera poses. Raises InputError naming the line."""
    found: list[CameraPose | None] = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        try:
            stored = np.array([float(word) for word in line.replace(",", " ").split()])
        except ValueError:
            stored = np.zeros(0)
        if stored.size == 0 and not line.strip():
            continue
        if stored.size != 16 or not np.isfinite(stored).all():
            raise InputError(f"{path}: line {number}: use 16 finite numbers")
        where = f"{path}: line {number}"
        turn, shift = rows_of_motion(stored.reshape(4, 4).T, where)
        found.append(inverse_pose(checked_rotation(turn, where), shift))
    return found


def describe_c3vd(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip of a pinhole camera. Raises InputError for another size."""
    number = lambda file: int(digits) if (digits := file.name.split("_")[0]).isdecimal() else -1
    files, planes = (sorted(visible_files(path, f"*{end}"), key=number) for end in (COLOUR, DEPTH))
    poses, maps = read_poses(path / POSES), pinhole_maps()
    if len(poses) != len(files):
        raise InputError(
            f"{path / POSES}: {len(poses)} poses for {counted(len(files), 'picture')}; use one per picture"
        )
    paired = matching_files(files, planes) if planes else []

    def pictures(wanted: list[int]) -> Iterator[PicturePair]:
        for i in wanted:
            picture = colour_picture(read_picture(files[i]), files[i])
            if picture.shape[:2] != (HEIGHT, WIDTH):
                raise InputError(f"{files[i]}: {picture.shape[1]}x{picture.shape[0]} pixels; use {WIDTH}x{HEIGHT}")
            yield PicturePair(remapped(picture, maps))

    def depth(i: int) -> NDArray[np.float32] | None:
        file = paired[i]
        if file is None:
            return None
        stored = read_plane(file)
        plane = np.where(stored < NO_DEPTH, stored * np.float32(STEP), 0).astype(np.float32)
        return remapped(plane, maps, nearest=True)

    return Clip(
        layout="c3vd",
        where=path,
        names=[file.stem for file in files],
        pictures=pictures,
        depth=Depth(depth) if planes else None,
        intrinsics=intrinsics_of_matrix(maps.matrix, WIDTH, HEIGHT, where=path),
        poses=poses,
        rate=options.rate,
        notes=[
            "the camera of C3VD is omnidirectional: undistorted to a pinhole camera of the same central focal length,"
            " with a horizontal field of view of 83 degrees",
            *of_no_or_all_frames(planes, paired),
        ],
    )


LAYOUT = Layout(
    name="c3vd",
    about=f"a sequence of C3VD with {POSES} and 0{COLOUR}",
    rank=2,
    recognises=recognises,
    describe=describe_c3vd,
    reads=FILES.listed,
)
