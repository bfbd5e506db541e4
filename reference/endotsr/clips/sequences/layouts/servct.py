"""SERV-CT: an experiment with rectified pairs and reference depth from CT. The pairs are separate views, not a film.

Left_rectified/, Right_rectified/     001.png ...
Rectified_calibration/                001.json ...: P1, P2 (3x4) in pixels and millimetres, OpenCV's convention
Ground_truth_CT/DepthL/               16 bits, millimetres times 256 (optional)
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL
from endotsr.clips.formats.camera import Intrinsics, intrinsics_of_matrix
from endotsr.clips.formats.files import check_pairing, list_pictures
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.pairing import matching_files, of_no_or_all_frames
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import depth_of, pictures_from_files, size_of, with_stated
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError
from endotsr.untrusted.json import read_json
from endotsr.untrusted.yaml import matrix

LEFT, RIGHT, CAMERAS, DEPTH = "Left_rectified", "Right_rectified", "Rectified_calibration", "Ground_truth_CT/DepthL"
CAMERA = Inventory(
    "a camera file of SERV-CT",
    used={
        "P1": "left camera: intrinsics, pixel centres at integers; the fourth column is 0",
        "P2": "right camera: the same intrinsics, and -fx times the baseline in millimetres",
    },
    harmless={"Q R1 R2 M1 M2 D1 D2 R T E F K1 K2 size image_size": "the pictures are rectified: P1 and P2 hold it"},
)
FILES = Inventory(
    "the folder of an experiment of SERV-CT",
    used={
        "left_rectified right_rectified": "the pictures of a pair",
        "rectified_calibration": "a camera file for each pair, all with one camera",
        "ground_truth_ct": "DepthL: depth of the left picture, millimetres times 256",
    },
    told={
        "left right": "pictures that are not rectified are not read",
        "ground_truth_rgb reference_rgb reference*": "another reference is not read: --depth",
    },
)
SAME = 1e-3  # pixels between the intrinsics of two rectified cameras
STEP = 1.0 / 256.0  # mm per step of the stored depth


def recognises(path: Path) -> bool:
    """Whether a path is the folder of an experiment."""
    return (path / LEFT).is_dir() and (path / CAMERAS).is_dir()


def read_camera(path: Path, width: int, height: int, notes: list[str]) -> tuple[Intrinsics, float]:
    """Intrinsics and baseline in millimetres of a pair; fields that are not known are noted.

    Raises:  InputError for two cameras whose intrinsics differ, and for a right camera that is not to the right.
    """
    found = read_json(path)
    notes += CAMERA.noted(found, path.name)
    left, right = (matrix(found.get(name), f"{path}: {name}", (3, 4)) for name in ("P1", "P2"))
    if right[0, 3] >= 0:
        raise InputError(
            f"{path}: P2: the fourth number is {right[0, 3]:g}; use a number below 0, -f times the baseline"
        )
    if left[:, 3].any() or np.abs(right[:, :3] - left[:, :3]).max() > SAME:
        raise InputError(f"{path}: P1 and P2: use one camera, with 0 in the fourth column of P1")
    return intrinsics_of_matrix(left[:, :3], width, height, where=path), float(-right[0, 3] / right[0, 0])


def describe_servct(path: Path, options: SourceOptions) -> Clip:
    """The experiment as a clip. Raises InputError for pairs whose cameras differ."""
    left, right = (list_pictures(path / name, PICTURE_ENDINGS) for name in (LEFT, RIGHT))
    check_pairing(left, right)
    width, height = size_of(left)
    files = list_pictures(path / CAMERAS, (".json",))
    notes: list[str] = []
    cameras = [read_camera(file, width, height, notes) for file in files]
    numbers = np.array([[*intrinsics[:4], baseline] for intrinsics, baseline in cameras])
    apart = np.flatnonzero(np.abs(numbers - numbers[0]).max(axis=1) > 1e-3)
    if apart.size:
        raise InputError(f"{files[apart[0]]}: another camera than {files[0].name}; use one for all frames")
    depth = list_pictures(path / DEPTH, DEPTH_ENDINGS) if (path / DEPTH).is_dir() else []
    planes = matching_files(left, depth) if depth else []
    clip = Clip(
        layout="servct",
        where=path,
        names=[file.stem for file in left],
        pictures=pictures_from_files(left, right),
        depth=depth_of(planes, STEP) if depth else None,
        intrinsics=cameras[0][0],
        baseline=cameras[0][1],
        inside=together(folders_of([*left, *right]), folders_of(depth, DEPTH_ENDINGS), {path / CAMERAS: ("*.json",)}),
        notes=[
            *sorted({note.split(": ", 1)[1] for note in notes}),
            *FILES.telling(sorted(file.name for file in path.iterdir()), path.name),
            f"{CAMERAS}: {HALF_A_PIXEL}",
            *of_no_or_all_frames(depth, planes),
            "the pairs of SERV-CT are separate views without poses: use them for `endotsr depth` and its comparison"
            " with the reference, not for training one scene",
        ],
    )
    return with_stated(clip, options)


LAYOUT = Layout(
    name="servct",
    about=f"an experiment of SERV-CT with {LEFT}/ and {CAMERAS}/",
    rank=2,
    recognises=recognises,
    describe=describe_servct,
    takes=("masks", "depth"),
    reads=FILES.listed,
)
