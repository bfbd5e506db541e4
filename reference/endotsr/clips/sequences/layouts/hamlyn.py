"""Hamlyn, rectified by Endo-Depth-and-Motion: one folder per clip, `rectified01` and so on.

color/ or image01/   left pictures, jpg or png
image02/             right pictures (optional); the folder does not state the baseline
depth/ or depth01/   16 bits, millimetres (optional)
intrinsics.txt       K of the rectified pictures, three lines of three or four numbers, OpenCV's convention
"""

from pathlib import Path

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL, read_matrix
from endotsr.clips.formats.camera import intrinsics_of_matrix
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

CAMERA = "intrinsics.txt"
LEFT, RIGHT, DEPTH = ("color", "image01"), ("image02",), ("depth", "depth01")
FILES = Inventory(
    "the folder of a clip of Hamlyn",
    used={
        "color image01": "left pictures; the first of the two folders",
        "image02": "right pictures",
        "depth depth01": "depth, millimetres; the first of the two folders",
        "intrinsics.txt": "K of the rectified pictures; a fourth column other than 0 is refused",
    },
)


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a camera matrix and one of the folders of left pictures."""
    return (path / CAMERA).is_file() and _first(path, LEFT) is not None


def _first(path: Path, names: tuple[str, ...]) -> Path | None:
    return next((path / name for name in names if (path / name).is_dir()), None)


def describe_hamlyn(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError."""
    left_folder, right_folder, depth_folder = (_first(path, names) for names in (LEFT, RIGHT, DEPTH))
    if left_folder is None or not (path / CAMERA).is_file():
        raise InputError(f"{path}: use a folder with {CAMERA} and {' or '.join(LEFT)}")
    left = list_pictures(left_folder, PICTURE_ENDINGS)
    right = list_pictures(right_folder, PICTURE_ENDINGS) if right_folder else []
    if right:
        check_pairing(left, right)
    width, height = size_of(left)
    depth = list_pictures(depth_folder, DEPTH_ENDINGS) if depth_folder else []
    planes = matching_files(left, depth) if depth else []
    clip = Clip(
        layout="hamlyn",
        where=path,
        names=[file.stem for file in left],
        pictures=pictures_from_files(left, right),
        depth=depth_of(planes, 1.0) if depth else None,
        intrinsics=intrinsics_of_matrix(read_matrix(path / CAMERA), width, height, where=path / CAMERA),
        baseline=options.baseline,
        read_here=tuple(folder.name for folder in (left_folder, right_folder, depth_folder) if folder is not None),
        inside=together(folders_of([*left, *right]), folders_of(depth, DEPTH_ENDINGS)),
        rate=options.rate,
        notes=[
            f"{CAMERA}: {HALF_A_PIXEL}",
            "the layout has no poses: the camera counts as static",
            *of_no_or_all_frames(depth, planes),
        ],
    )
    return with_stated(clip, options)


LAYOUT = Layout(
    name="hamlyn",
    about=f"a folder of Hamlyn with {CAMERA} and color/ or image01/",
    rank=2,
    recognises=recognises,
    describe=describe_hamlyn,
    takes=("masks", "depth", "baseline"),
    reads=(CAMERA,),
)
