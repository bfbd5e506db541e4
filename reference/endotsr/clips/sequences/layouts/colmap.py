"""A COLMAP model with its pictures: poses, intrinsics and points of a reconstruction of unknown scale.

`colmap_folders` finds the models (cameras, images, points3D; .txt or .bin) and their pictures. Frames are the
registered pictures of one model, ordered by the numbers in their names.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.camera import ARBITRARY, shared_intrinsics
from endotsr.clips.formats.colmap_folders import choose_model, files_of_model, find_models, unregistered
from endotsr.clips.formats.colmap_model import ModelImage, read_model
from endotsr.clips.formats.files import shortened, time_order, visible_files
from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.sequences.checks.frames import gap_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.layouts.pictures import PAIRS
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import pictures_from_files, stated_masks
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError
from endotsr.untrusted.names import counted


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a COLMAP model."""
    return path.is_dir() and bool(find_models(path))


def describe_colmap(path: Path, options: SourceOptions) -> Clip:
    """The model as a clip. Raises InputError for a missing picture, or for cameras that differ."""
    folder, notes = choose_model(path, options.model)
    model = read_model(folder)
    if not model.images:
        raise InputError(f"{folder}: the model holds no registered picture; use a model with registered pictures")
    registered = _one_side(model.images, notes)
    files = files_of_model(path, folder, [image.name for image in registered])
    order = time_order(files)
    files, images = [files[i] for i in order], [registered[i] for i in order]
    notes.insert(0, f"{folder.name}: {len(files)} registered pictures, {counted(len(model.points), 'point')}")
    notes += _of_nerfstudio(path)
    intrinsics = shared_intrinsics([model.cameras[image.camera] for image in images], folder, notes)
    notes += picture_notes(files) + unregistered(files) + [found.line for found in gap_findings(files)]
    empty, named = np.zeros((0, 3)), {key for image in images for key in image.points.tolist()}
    if lost := len(named - set(model.points)):
        notes.append(
            f"{folder.name}: {lost} of {len(named)} points of the pictures are not in points3D: no depth there"
        )

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
        inside=together(
            folders_of(files), {parent: IN_MODELS for parent in (folder, *folder.parents) if path in parent.parents}
        ),
        notes=notes,
    )


def _of_nerfstudio(path: Path) -> list[str]:
    """A note on a project of nerfstudio, which keeps the model beside its own file."""
    files = [file.name for file in visible_files(path, "transforms*.json")]
    if not files:
        return []
    return [
        f"{shortened(files)}: not read, because the COLMAP model is; --layout nerfstudio reads masks, depth and times"
        " that it names"
    ]


def _one_side(images: list[ModelImage], notes: list[str]) -> list[ModelImage]:
    """The pictures of the left camera, if the model has those of both; noted."""
    folders = {image.name.replace("\\", "/").split("/")[0] for image in images if "/" in image.name}
    pair = next(((left, right) for left, right in PAIRS if folders == {left, right}), None)
    if pair is None or not all("/" in image.name for image in images):
        return images
    left = [image for image in images if image.name.startswith(f"{pair[0]}/")]
    notes.append(f"{pair[0]}/ and {pair[1]}/ are one model: {len(images) - len(left)} pictures of {pair[1]}/ not read")
    return left


IN_MODELS = ("[0-9]*", "sparse", "images", "stereo", "cameras.*", "images.*", "points3d.*", "rigs.*", "frames.*",
             "project.ini", "*.db", "run-colmap-*")  # fmt: skip
LAYOUT = Layout(
    name="colmap",
    about="a folder with a COLMAP model and images/",
    rank=2,
    recognises=recognises,
    describe=describe_colmap,
    takes=("masks",),
    reads=("images*", "input", "sparse", "colmap", "dense", "distorted", "stereo", "cameras.*", "images.*",
           "points3d.*", "rigs.*", "frames.*", "project.ini", "*.db", "run-colmap-*", "transforms*.json", "left",
           "right"),
)  # fmt: skip
