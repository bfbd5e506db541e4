"""A COLMAP model with its pictures: poses, intrinsics and points of a reconstruction of unknown scale.

The model (cameras, images, points3D; .txt or .bin) is in the folder, in sparse/0 or in sparse; the pictures are in
images/ or in the folder. Frames are the registered pictures, ordered by the numbers in their names.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.sequences.camera import ARBITRARY
from endotsr.clips.sequences.checks.frames import gap_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.colmap_model import find_model, read_model
from endotsr.clips.sequences.files import time_order
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import pictures_from_files, stated_masks
from endotsr.errors import InputError
from endotsr.untrusted.names import relative_path


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a COLMAP model."""
    return path.is_dir() and find_model(path) is not None


def describe_colmap(path: Path, options: SourceOptions) -> Clip:
    """The model as a clip. Raises InputError for a missing picture, or for several cameras."""
    folder = find_model(path)
    if folder is None:
        raise InputError(f"{path}: holds no COLMAP model (cameras.txt or cameras.bin, also in sparse/0)")
    model = read_model(folder)
    if not model.images:
        raise InputError(f"{folder}: the model holds no registered picture")
    used = {image.camera for image in model.images}
    if len({model.cameras[key] for key in used}) > 1:
        raise InputError(f"{folder}: {len(used)} cameras with different intrinsics; allowed: one for all frames")
    files = [_file(path, image.name) for image in model.images]
    order = time_order(files)
    files, images = [files[i] for i in order], [model.images[i] for i in order]
    intrinsics = model.cameras[images[0].camera]
    empty = np.zeros((0, 3))

    def points(i: int) -> np.ndarray:
        seen = [model.points[key] for key in images[i].points.tolist() if key in model.points]
        return np.array(seen) if seen else empty

    return Clip(
        layout="colmap",
        where=path,
        names=[file.stem for file in files],
        pictures=pictures_from_files(files, []),
        masks=stated_masks(options, files, intrinsics.width, intrinsics.height),
        points=points,
        unit=ARBITRARY,
        intrinsics=intrinsics,
        poses=[image.pose for image in images],
        rate=options.rate,
        notes=[f"{folder.name}: {len(files)} registered pictures, {len(model.points)} points"]
        + [found.line for found in gap_findings(files)],
    )


def _file(path: Path, name: str) -> Path:
    """The file of a registered picture. Raises InputError if it is missing or outside the folder."""
    inner = relative_path(name, f"{path}: a picture of the COLMAP model")
    for place in (path / "images" / inner, path / inner):
        if place.is_file():
            return place
    raise InputError(f"{path / 'images' / inner}: file not found; the COLMAP model registers it")


LAYOUT = Layout(
    name="colmap",
    about="a folder with a COLMAP model and images/",
    rank=2,
    recognises=recognises,
    describe=describe_colmap,
    takes=("masks",),
)
