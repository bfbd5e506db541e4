"""The files of a sequence. Missing files become findings, and the rest is checked."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.common import Contents, cameras_of, polarity
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.endonerf import NO_MASKS
from endotsr.clips.sequences.files import list_pictures
from endotsr.clips.sequences.layouts import readable_layout
from endotsr.clips.sequences.poses import POSE_FILES, cameras_from_rows, find_pose_file, read_pose_rows
from endotsr.clips.sequences.sequence_file import FILE_NAME, IMAGES, RIGHT, SequenceFile, read_poses, read_sequence_file
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera


class Parts(NamedTuple):
    """The parts of a sequence; lists of missing parts are empty."""

    folder: Path
    images: list[Path]
    masks: list[Path]
    depth: list[Path]
    right: list[Path]
    excluded_value: str
    depth_scale: float  # to scene units
    arbitrary: bool
    camera_file: Path
    cameras: Callable[[int, int], list[Camera]]  # of pictures of this width and height
    seconds: NDArray[np.float64] | None = None  # of uneven frames; None: evenly spaced
    stated_in: str = ""  # the file that states the polarity of the masks; "": the settings state it
    assumed: str = ""  # properties of the depth that are not measured


def parts_of(folder: Path, config: SequenceConfig, findings: list[Finding]) -> Parts:
    """List the parts of a folder in the common or the EndoNeRF layout; findings are appended.

    Raises:  InputError without a folder, or for a layout that needs `endotsr prepare`.
    """
    if not folder.exists():
        raise InputError(f"{folder}: sequence folder not found")
    layout = readable_layout(folder)
    return (_common_parts if layout.name == "common" else _endonerf_parts)(folder, config, findings)


def _listed(folder: Path, endings: tuple[str, ...], what: str, findings: list[Finding]) -> list[Path]:
    try:
        return list_pictures(folder, endings)
    except InputError as error:
        findings.append(finding(f"{what}-files", folder, str(error)))
        return []


def _endonerf_parts(folder: Path, config: SequenceConfig, findings: list[Finding]) -> Parts:
    images = _listed(folder / IMAGES, PICTURE_ENDINGS, "images", findings)
    masks = [] if config.masks == NO_MASKS else _listed(folder / config.masks, PICTURE_ENDINGS, "masks", findings)
    depth = _listed(folder / "depth", DEPTH_ENDINGS, "depth", findings)
    right = list_pictures(folder / RIGHT, PICTURE_ENDINGS) if (folder / RIGHT).is_dir() else []

    def cameras(width: int, height: int) -> list[Camera]:
        file = find_pose_file(folder)
        rows = read_pose_rows(file, len(images))
        return cameras_from_rows(rows, width, height, file, range(len(images)))

    where = next((folder / name for name in POSE_FILES if (folder / name).exists()), folder)
    return Parts(folder, images, masks, depth, right, config.excluded_value, 1.0, False, where, cameras)


def _common_parts(folder: Path, config: SequenceConfig, findings: list[Finding]) -> Parts:
    where = folder / FILE_NAME
    try:
        file = read_sequence_file(folder)
    except InputError as error:
        findings.append(finding("sequence-file", where, str(error)))
        return Parts(folder, [], [], [], [], "white", 1.0, False, where, lambda width, height: [])
    findings += _stated(file, where)
    images = _listed(folder / IMAGES, PICTURE_ENDINGS, "images", findings)
    wanted = file.masks is not None and config.masks != NO_MASKS
    masks = _listed(folder / file.masks.folder, PICTURE_ENDINGS, "masks", findings) if file.masks and wanted else []
    depth = _listed(folder / file.depth.folder, DEPTH_ENDINGS, "depth", findings) if file.depth else []
    right = list_pictures(folder / RIGHT, PICTURE_ENDINGS) if (folder / RIGHT).is_dir() else []

    def cameras(width: int, height: int) -> list[Camera]:
        if (file.camera.width, file.camera.height) != (width, height):
            raise InputError(
                f"{where}: states {file.camera.width}x{file.camera.height}, the pictures have {width}x{height}"
            )
        if file.frames != len(images):
            raise InputError(f"{where}: frames = {file.frames}, but images/ holds {len(images)} pictures")
        return cameras_of(Contents(folder, file, images, right, masks, depth, read_poses(file, where)))

    excluded, stated_in = polarity(file, folder, config)
    seconds = None if file.times is None else np.array(file.times, np.float64)
    assumed = file.depth.assumed if file.depth else ""
    return Parts(
        folder, images, masks, depth, right, excluded, file.depth_scale, file.arbitrary, where, cameras, seconds,
        stated_in, assumed,
    )  # fmt: skip


def _stated(file: SequenceFile, where: Path) -> list[Finding]:
    """Findings on the statements of `sequence.toml`."""
    found = []
    if file.depth is None:
        found.append(finding("no-depth", where, "[depth] is missing"))
    if file.masks is None:
        found.append(finding("no-masks", where, "there are no masks"))
    elif file.masks.proposed:
        found.append(finding("proposed-masks", where, "a program proposed the masks"))
    if any(file.camera.distortion):
        found.append(finding("distortion", where, "the pictures are distorted"))
    return found
