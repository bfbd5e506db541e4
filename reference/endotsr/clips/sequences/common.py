"""Reading the common format: `sequence.toml` with `images/`, `masks/`, `depth/` and `images_right/`.

In: a folder and the `SequenceConfig`. Out: a `Sequence`, or a `Clip` for `prepare` and `depth`. `sequence_file`
describes the fields of `sequence.toml`. The file states the units and the polarity of the masks; the setting
`sequence.excluded_value = "black"` overrides the polarity.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.clips.sequences.assemble import assemble, check_percentiles
from endotsr.clips.sequences.checks.kinds import KINDS, ONE_CAMERA
from endotsr.clips.sequences.clip import CameraPose, Clip, PicturePair, colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS, depth_plane, read_plane
from endotsr.clips.sequences.files import check_pairing, hash_files, list_pictures
from endotsr.clips.sequences.masks import tissue_masks
from endotsr.clips.sequences.read_frames import FrameFiles, of_size
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.sequence_file import (
    FILE_NAME,
    IMAGES,
    RIGHT,
    SequenceFile,
    read_poses,
    read_poses_with_gaps,
    read_sequence_file,
)
from endotsr.clips.sequences.splits import selected_frames
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera

STATES = f"{FILE_NAME} states"
EVERYTHING = (0.0, 100.0)  # percentiles that clip nothing


class Contents(NamedTuple):
    """The files of a folder in the common format, all frames, in time order."""

    folder: Path
    file: SequenceFile
    images: list[Path]
    right: list[Path]  # empty: no right pictures
    masks: list[Path]  # empty: no masks
    depth: list[Path]  # empty: no depth
    poses: list[CameraPose] | None


def recognises(path: Path) -> bool:
    """Whether a path is a folder in the common format."""
    return (path / FILE_NAME).is_file()


def list_contents(folder: Path, poses: bool = True) -> Contents:
    """List and pair the files. `poses=False` ignores faults of the poses.

    Raises:  InputError for a file without its partner, a contradicting frame count, or an invalid pose.
    """
    folder = Path(folder)
    found = read_sequence_file(folder)
    images = list_pictures(folder / IMAGES, PICTURE_ENDINGS)
    if len(images) != found.frames:
        raise InputError(f"{folder / FILE_NAME}: frames = {found.frames}, but images/ holds {len(images)} pictures")
    right = list_pictures(folder / RIGHT, PICTURE_ENDINGS) if (folder / RIGHT).is_dir() else []
    masks = list_pictures(folder / found.masks.folder, PICTURE_ENDINGS) if found.masks else []
    depth = list_pictures(folder / found.depth.folder, DEPTH_ENDINGS) if found.depth else []
    for other in (right, masks, depth):
        if other:
            check_pairing(images, other)
    return Contents(
        folder, found, images, right, masks, depth, read_poses(found, folder / FILE_NAME) if poses else None
    )


def select_contents(folder: Path, config: SequenceConfig) -> tuple[Contents, range]:
    """The contents read by training, and the selected frames. Raises InputError for contents unusable for training."""
    contents = list_contents(folder)
    if contents.file.camera.distortion and any(contents.file.camera.distortion):
        raise InputError(
            f"{folder}: the pictures are distorted (camera.distortion); `endotsr prepare {folder} --out FOLDER`"
            " straightens them"
        )
    if not contents.depth:
        remedy = "`endotsr depth` makes it from the stereo pair" if contents.right else ONE_CAMERA
        if contents.right and not contents.file.camera.baseline:
            remedy += f", once [camera] baseline, the distance between the two cameras, is stated in {FILE_NAME}"
        raise InputError(f"{folder}: no depth: [depth] is missing in {FILE_NAME}; {remedy}")
    if config.masks == "gt_masks":
        raise InputError(
            f"{folder}: sequence.masks = 'gt_masks': {FILE_NAME} names the mask folder; allowed: masks, none"
        )
    if config.masks == "none":
        contents = contents._replace(masks=[])
    frames = selected_frames(config, len(contents.images), folder)
    chosen = {
        name: [getattr(contents, name)[i] for i in frames if getattr(contents, name)]
        for name in ("images", "right", "masks", "depth")
    }
    poses = [contents.poses[i] for i in frames] if contents.poses else None
    return contents._replace(**chosen, poses=poses), frames


def read_common(folder: Path, config: SequenceConfig, near: float) -> Sequence:
    """Read the frames that `config` selects, with the steps of `read_endonerf`.

    near     near plane, scene units

    Raises:  InputError naming the file, the frame or the key.
    """
    check_percentiles(config)
    contents, frames_read = select_contents(folder, config)
    notes = [f"source: {contents.file.source}"] if contents.file.source else []
    if contents.file.masks and contents.file.masks.proposed and contents.masks:
        notes.append("masks: proposed by a program, not checked by a person")
    excluded, stated_in = polarity(contents.file, contents.folder, config)
    if contents.masks and not stated_in and contents.file.masks and excluded != contents.file.masks.excluded_value:
        notes.append(f"sequence.excluded_value = {excluded!r} overrides the value in {FILE_NAME}")
    entry, times, camera = contents.file.depth, contents.file.times, contents.file.camera
    assert entry is not None
    if entry.clipped and entry.clipped == list(config.depth_percentiles):
        config = msgspec.structs.replace(config, depth_percentiles=EVERYTHING)
        notes.append(f"depth: clipped to its percentiles {entry.clipped} when it was resized, and not again")
    if entry.assumed:
        notes.append(f"not metric: {entry.method}; {KINDS['assumed-depth'].why}")
    files = FrameFiles(
        contents.images,
        contents.masks,
        contents.depth,
        size=(camera.width, camera.height),
        size_said=STATES,
        excluded_value=excluded,
        unit=contents.file.unit_in_words,
        depth_unit=entry.unit,
        depth_scale=contents.file.depth_scale,
        stated_in=stated_in,
        arbitrary=contents.file.arbitrary,
        assumed=entry.assumed,
        seconds=None if times is None else np.array([times[i] for i in frames_read], np.float64),
        duration=_duration(contents.file, frames_read),
    )
    return assemble(files, cameras_of(contents), config, near, Path(folder), notes)


def _duration(file: SequenceFile, frames: range | list[int]) -> float:
    """Seconds from time 0 to time 1 of these frames, n / (n - 1) (s_{n-1} - s_0); 0 where the rate is unknown."""
    if not file.frame_rate or len(frames) < 2:
        return 0.0
    first, last = frames[0], frames[-1]
    elapsed = (last - first) / file.frame_rate if file.times is None else file.times[last] - file.times[first]
    return elapsed * len(frames) / (len(frames) - 1)


def polarity(file: SequenceFile, folder: Path, config: SequenceConfig) -> tuple[str, str]:
    """The excluded value of the masks, and the file that states it; "" if the settings state it.

    A setting other than the default, white, overrides the file.
    """
    stated = file.masks.excluded_value if file.masks else "white"
    return (config.excluded_value, "") if stated == "white" else (stated, str(Path(folder) / FILE_NAME))


def common_hashes(folder: Path, config: SequenceConfig) -> dict[str, str]:
    """SHA-256 (hex) of every file that `read_common` reads with this configuration, by path inside the folder."""
    contents, _ = select_contents(folder, config)
    files = [Path(folder) / FILE_NAME, *contents.images, *contents.masks, *contents.depth]
    return hash_files(Path(folder), files)


def cameras_of(contents: Contents) -> list[Camera]:
    """One camera per frame; the same object for all frames of a static camera."""
    entry, count = contents.file.camera, len(contents.images)
    intrinsics = (entry.fx, entry.fy, entry.cx, entry.cy, entry.width, entry.height)
    poses = contents.poses or [CameraPose(np.eye(3), np.zeros(3))]
    cameras = [Camera(*pose, *intrinsics) for pose in poses]
    static = all((pose.rotation == poses[0].rotation).all() for pose in poses)
    static &= all((pose.translation == poses[0].translation).all() for pose in poses)
    return cameras[:1] * count if static else cameras


def _sized(contents: Contents, pixels: NDArray, path: Path) -> NDArray:
    return of_size(pixels, path, (contents.file.camera.width, contents.file.camera.height), STATES)


def _colour(contents: Contents, path: Path) -> NDArray[np.uint8]:
    return colour_picture(_sized(contents, read_picture(path), path), path)


def open_common(folder: Path) -> Clip:
    """The whole folder as a clip, decoded on demand. An invalid pose becomes a gap. Raises InputError."""
    contents = list_contents(folder, poses=False)
    found = contents.file
    poses, faults = read_poses_with_gaps(found, folder / FILE_NAME)

    def pictures(wanted: list[int]) -> Iterator[PicturePair]:
        for i in wanted:
            right = _colour(contents, contents.right[i]) if contents.right else None
            yield PicturePair(_colour(contents, contents.images[i]), right)

    def mask(i: int) -> NDArray[np.bool_]:
        assert found.masks is not None
        path = contents.masks[i]
        plane = grey_plane(_sized(contents, read_picture(path), path), path)
        return tissue_masks([plane], [str(path)], found.masks.excluded_value)[0]

    def depth(i: int) -> NDArray[np.float32]:
        path = contents.depth[i]
        return depth_plane(_sized(contents, read_plane(path), path), found.depth_scale, path)

    return Clip(
        layout="common",
        where=Path(folder),
        names=[file.stem for file in contents.images],
        pictures=pictures,
        masks=mask if contents.masks else None,
        proposed=bool(found.masks and found.masks.proposed and contents.masks),
        depth=depth if contents.depth else None,
        depth_clipped=bool(found.depth and found.depth.clipped),
        depth_method=found.depth.method if found.depth else "given",
        depth_assumed=found.depth.assumed if found.depth else "",
        unit="arbitrary" if found.arbitrary else "mm",
        intrinsics=found.camera.intrinsics(folder),
        baseline=found.baseline or None,
        poses=poses,
        rate=found.frame_rate or None,
        times=None if found.times is None else np.array(found.times, np.float64),
        notes=[*([f"source: {found.source}"] if found.source else []), *faults],
    )
