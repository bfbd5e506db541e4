"""TUM RGB-D folders: `rgb.txt`, `rgb/`, and optionally `depth.txt`, `depth/` and `groundtruth.txt`.

`rgb.txt` and `depth.txt` have one line per picture, `time file`. `groundtruth.txt` is a camera-to-world trajectory in
seconds and metres. Depth has 5000 steps per metre, or as many as `DepthMapFactor` in settings of ORB-SLAM states.
Pictures, depth and poses are matched by time, to `LONGEST`.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL
from endotsr.clips.formats.calibrations import StatedCamera, calibrated
from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.formats.files import shortened, visible_files
from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.formats.trajectory import TICKS, USUAL_UNIT, poses_at, read_trajectory
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip, Depth
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import (
    depth_of,
    pictures_from_files,
    replaced,
    size_of,
    stated_camera,
    stated_depth,
    stated_masks,
)
from endotsr.clips.sequences.times import usual_rate
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import number
from endotsr.untrusted.names import relative_path
from endotsr.untrusted.yaml import read_yaml

LIST, DEPTH_LIST = "rgb.txt", "depth.txt"
TRAJECTORIES = (
    "groundtruth.txt",
    "CameraTrajectory.txt",
    "KeyFrameTrajectory.txt",
)  # the last two: ORB-SLAM
SETTINGS = ".fx:"  # in the settings of ORB-SLAM
FACTORS = ("DepthMapFactor", "RGBD.DepthMapFactor")  # of its versions 2 and 3: steps of the depth per metre
STEPS = 5000.0  # per metre, of the stored depth
LONGEST = 0.02  # seconds between a picture and its depth or pose
DEFAULT = (525.0, 525.0, 320.0, 240.0)  # the intrinsics recommended by the authors of the layout, 640x480


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a list of timed pictures."""
    return (path / LIST).is_file()


def read_list(path: Path) -> tuple[np.ndarray, list[Path]]:
    """Seconds and files of a list, in time order; stamps of other programs may be nanoseconds, as in trajectories.

    Raises:  InputError naming the line.
    """
    times, files = [], []
    for place, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split(maxsplit=1)
        if not words or words[0].startswith("#"):
            continue
        try:
            time = float(words[0])
        except ValueError:
            time = float("nan")
        if len(words) != 2 or not np.isfinite(time):
            raise InputError(f"{path}: line {place}: use a time in seconds and the name of a file")
        times.append(time)
        files.append(path.parent / relative_path(words[1].strip(), f"{path}: line {place}"))
    if not times:
        raise InputError(f"{path}: names no picture; use lines of a time in seconds and the name of a file")
    order = np.argsort(times, kind="stable")
    stamps = np.array(times)[order]
    step = next(step for least, step, _ in TICKS if stamps[0] >= least)
    return stamps * step, [files[i] for i in order]


def _unlisted(path: Path, files: list[Path]) -> list[str]:
    """A note on pictures in the folders of a list that it does not name."""
    stored = {file for folder in {file.parent for file in files} if folder.is_dir() for file in folder.iterdir()}
    found = sorted(file.name for file in stored - set(files) if file.suffix.lower() in PICTURE_ENDINGS)
    return [f"{path.name}: without a line in {LIST}, left out: {shortened(found)}"] if found else []


def _depth_steps(settings: Path | None, notes: list[str]) -> float:
    """Steps of the stored depth per metre: those of the settings, noted, or of the layout. Raises InputError."""
    keys = {} if settings is None else read_yaml(settings)
    name = next((name for name in FACTORS if name in keys), None)
    if settings is None or name is None:
        return STEPS
    found = number(keys[name], f"{settings}: {name}", 1e-3, 1e9)
    notes.append(f"{settings.name}: {name}: the depth has {found:g} steps per metre")
    return found


def _listed_depth(path: Path, times: np.ndarray, step: float) -> Depth | None:
    """The depth of `depth.txt` nearest in time to each picture, `step` mm per number; None without the file."""
    if not (path / DEPTH_LIST).is_file():
        return None
    stamps, planes = read_list(path / DEPTH_LIST)
    nearest = np.abs(stamps[None, :] - times[:, None]).argmin(axis=1)
    paired = [planes[k] if abs(stamps[k] - t) <= LONGEST else None for k, t in zip(nearest, times)]
    return depth_of(paired, step)


def _poses(
    options: SourceOptions, given: list[Path], times: np.ndarray, notes: list[str]
) -> list[CameraPose | None] | None:
    """The pose of each picture by the stated trajectory, or else by the first one of the folder; None without one."""
    where = options.trajectory or next(iter(given), None)
    if where is None:
        return None
    found = read_trajectory(where, options.trajectory_unit or USUAL_UNIT, options.direction).in_seconds()
    others = "".join(f"; not read: {file.name}" for file in given if file != where)
    notes += [f"poses of {where.name}{others}", *found.notes]
    return poses_at(found, times, LONGEST)


def describe_tum(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError."""
    times, files = read_list(path / LIST)
    notes = _unlisted(path, files)
    if pairs := [file.name for file in visible_files(path, "associat*.txt")]:
        notes.append(f"{shortened(pairs)}: not read; pictures, depth and poses are paired by their times")
    width, height = size_of(files)
    camera = stated_camera(options, width, height, path)
    notes += picture_notes(files)
    given = [path / name for name in TRAJECTORIES if (path / name).is_file()]
    settings = next((file for file in visible_files(path, "*.yaml") if SETTINGS in read_text(file)), None)
    if camera.intrinsics is None and settings is not None:
        camera = calibrated(settings, width, height)
        notes.append(f"intrinsics of {settings.name}: {HALF_A_PIXEL}")
    if camera.intrinsics is None and (width, height) == (640, 480):
        camera = StatedCamera(Intrinsics(*DEFAULT, width, height))
        notes.append("no --camera: the intrinsics recommended by the authors of the layout")
    poses = _poses(options, given, times, notes)
    planes = read_list(path / DEPTH_LIST)[1] if (path / DEPTH_LIST).is_file() else []
    if planes and options.depth is not None:
        notes.append(replaced(DEPTH_LIST, "depth"))
    steps_of_depth = _depth_steps(settings, notes) if planes and options.depth is None else STEPS
    steps = np.diff(times)
    return Clip(
        layout="tum",
        where=path,
        names=[file.stem for file in files],
        pictures=pictures_from_files(files, []),
        masks=stated_masks(options, files, width, height),
        depth=stated_depth(options, files) or _listed_depth(path, times, 1000.0 / steps_of_depth),
        unit="mm",
        intrinsics=camera.intrinsics,
        poses=poses,
        rate=usual_rate(times),
        times=times if steps.size and (steps > 0).all() else None,
        read_here=tuple(file.name.lower() for file in [*given, *([settings] if settings else [])]),
        inside=together(folders_of(files), folders_of(planes, DEPTH_ENDINGS)),
        notes=[*notes, *camera.notes],
    )


LAYOUT = Layout(
    name="tum",
    about="a folder with rgb.txt and rgb/",
    rank=3,
    recognises=recognises,
    describe=describe_tum,
    takes=("camera", "distortion", "calibration", "trajectory", "masks", "depth"),
    reads=("rgb.txt", "rgb", "depth.txt", "depth", "accelerometer.txt", "associat*.txt"),
)
