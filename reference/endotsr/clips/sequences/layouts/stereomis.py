"""StereoMIS as distributed: one stacked video (left on top), calibration, trajectory and tissue masks.

*.mp4 or another video     left over right; pictures are numbered from 0
StereoCalibration.ini      see `calibration_formats`; for one picture of the pair, millimetres
groundtruth.txt            frame tx ty tz qx qy qz qw, camera-to-world, metres (optional)
masks/000123l.png          of the left picture, any value above 0 = tissue, perhaps at half size (optional)
"""

from dataclasses import replace
from pathlib import Path

from endotsr.clips.formats.files import list_pictures, visible_files
from endotsr.clips.formats.video_file import VIDEO_ENDINGS
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.layouts.video import describe_video
from endotsr.clips.sequences.pairing import matching_files, of_no_or_all_frames
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import masks_of, replaced
from endotsr.clips.sequences.unread import folders_of
from endotsr.errors import InputError

CALIBRATION = "StereoCalibration.ini"
TRAJECTORY = "groundtruth.txt"
MASKS = "masks"


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a stereo calibration and a video."""
    return (path / CALIBRATION).is_file() and bool(_videos(path))


def _videos(path: Path) -> list[Path]:
    return [file for file in visible_files(path) if file.suffix.lower() in VIDEO_ENDINGS] if path.is_dir() else []


def describe_stereomis(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError for more than one video, and for invalid files."""
    videos = _videos(path)
    if len(videos) != 1:
        raise InputError(f"{path}: {len(videos)} videos ({', '.join(v.name for v in videos)}); use one")
    trajectory = path / TRAJECTORY
    stated = replace(
        options,
        stereo="stacked" if options.stereo == "auto" else options.stereo,
        calibration=options.calibration or path / CALIBRATION,
        trajectory=options.trajectory or (trajectory if trajectory.is_file() else None),
        trajectory_unit=options.trajectory_unit or "m",
    )
    clip = describe_video(videos[0], stated)
    notes = [*clip.notes, *_overridden(path, options)]
    if stated.trajectory is None:
        notes.append(f"{TRAJECTORY} is missing: the camera counts as static")
    masks, inside = clip.masks, {}
    if options.masks is None and (path / MASKS).is_dir():
        camera = clip.calibration.left if clip.calibration else clip.intrinsics
        assert camera is not None  # a calibration file states one
        stored = list_pictures(path / MASKS, PICTURE_ENDINGS)
        files = matching_files(clip.count, stored)
        notes += of_no_or_all_frames(stored, files)
        inside = folders_of(files)
        masks = masks_of(files, "black", camera.width, camera.height)
    elif masks is None:
        notes.append(f"{MASKS}/ is missing: every pixel counts as tissue")
    return replace(
        clip,
        layout="stereomis",
        where=path,
        masks=masks,
        unit="mm",
        notes=notes,
        inside=inside,
        read_here=(videos[0].name.lower(),),
    )


def _overridden(path: Path, options: SourceOptions) -> list[str]:
    """Notes on the parts of the folder in whose place an option states another file."""
    parts = {"calibration": CALIBRATION, "trajectory": TRAJECTORY, "masks": MASKS}
    return [
        replaced(name, option)
        for option, name in parts.items()
        if (stated := getattr(options, option)) is not None
        and (path / name).exists()
        and stated.resolve() != (path / name).resolve()
    ]


LAYOUT = Layout(
    name="stereomis",
    about="a folder with a stacked video and StereoCalibration.ini",
    rank=2,
    recognises=recognises,
    describe=describe_stereomis,
    takes=("stereo", "calibration", "trajectory", "masks", "depth", "orientation"),
    reads=(
        "stereocalibration.ini",
        "groundtruth.txt",
        "masks",
        "video_frames",
    ),
)
