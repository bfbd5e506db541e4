"""EndoNeRF folders: `images/`, `depth/`, `masks/` and `poses_bounds.npy`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.config import SequenceConfig
from endotsr.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.sequences.endonerf import UNIT, input_hashes, read_endonerf, select_files
from endotsr.sequences.files import check_pairing, list_pictures
from endotsr.sequences.layouts import Layout
from endotsr.sequences.masks import tissue_masks
from endotsr.sequences.poses import POSE_FILES, cameras_from_rows, read_pose_rows
from endotsr.sequences.recording import CameraPose, Lens, Recording, colour_picture, grey_plane
from endotsr.sequences.source_options import SourceOptions
from endotsr.sequences.sources import depth_reader, pictures_from_files, stated_depth, stated_masks

RIGHT = "images_right"


def recognises(path: Path) -> bool:
    """Whether a path is a folder with pictures, depth and an LLFF pose file."""
    return (path / "images").is_dir() and any((path / name).is_file() for name in POSE_FILES)


def open_endonerf(folder: Path, options: SourceOptions) -> Recording:
    """The folder as a recording. Raises InputError."""
    config = SequenceConfig(masks="masks" if (folder / "masks").is_dir() else "none")
    files = select_files(folder, config)
    height, width = colour_picture(read_picture(files.images[0]), files.images[0]).shape[:2]
    rows = read_pose_rows(files.poses, files.total)
    cameras = cameras_from_rows(rows, width, height, files.poses, files.frames)
    right = list_pictures(folder / RIGHT, PICTURE_ENDINGS) if (folder / RIGHT).is_dir() else []
    if right:
        check_pairing(files.images, right)

    def mask(i: int) -> NDArray[np.bool_]:
        plane = grey_plane(read_picture(files.masks[i]), files.masks[i])
        return tissue_masks([plane], [str(files.masks[i])], options.excluded_value)[0]

    first = cameras[0]
    return Recording(
        layout="endonerf",
        where=folder,
        names=[file.stem for file in files.images],
        pictures=pictures_from_files(files.images, right),
        masks=stated_masks(options, files.images, width, height) or (mask if files.masks else None),
        depth=stated_depth(options, files.images) or depth_reader([*files.depth], 1.0),
        unit=UNIT,
        lens=Lens(first.fx, first.fy, first.cx, first.cy, width, height),
        baseline=options.baseline,
        poses=None
        if cameras[0] is cameras[-1]
        else [CameraPose(camera.rotation, camera.translation) for camera in cameras],
        rate=options.rate,
    )


LAYOUT = Layout(
    name="endonerf",
    about="a folder with images/, depth/, masks/ and poses_bounds.npy",
    rank=1,
    recognises=recognises,
    open=open_endonerf,
    read=read_endonerf,
    hashes=input_hashes,
    takes=("baseline", "masks", "depth"),
)
