"""A plain folder of pictures, or one picture: png, jpg, tiff, webp or bmp, one per frame, alone or as stereo pairs.

A folder with `left/` and `right/` (or `images/` and `images_right/`, `image_0/` and `image_1/`, `cam0/` and `cam1/`),
or with `000_left.png` and `000_right.png` (or `000_l.png`, `left_000.png`), is a stereo clip. A list of times beside
the pictures states their times; names that are seconds with decimals state them too. All other properties are stated
on the command line.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import check_pairing, frame_numbers, visible_files
from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.formats.time_lists import PictureTimes, picture_times
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.checks.frames import gap_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import STATEMENTS, Layout
from endotsr.clips.sequences.record import is_run
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import (
    files_of,
    pictures_from_files,
    size_of,
    stated_camera,
    stated_depth,
    stated_masks,
    stated_poses,
    unit_of,
)
from endotsr.clips.sequences.stored_pairs import squeezed_note, view_size
from endotsr.clips.sequences.times import usual_rate
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError

PAIRS = (("left", "right"), ("images", "images_right"), ("image_0", "image_1"), ("left_images", "right_images"),
         ("left_frames", "right_frames"), ("left_rectified", "right_rectified"),
         ("image_2", "image_3"), ("Left", "Right"), ("cam0", "cam1"), ("image01", "image02"))  # fmt: skip
SIDE = re.compile(r"(?:^|[-_. ])(left|right|l|r)(?:[-_. ]|$)|(?<=\d)(l|r)$", re.IGNORECASE)  # in the stem of a name


def recognises(path: Path) -> bool:
    """Whether a path is a picture, or a folder with pictures directly or in a known pair of folders."""
    if path.is_file():
        return path.suffix.lower() in PICTURE_ENDINGS
    return (
        path.is_dir()
        and not is_run(path)
        and any(_holds_pictures(folder) for folder in (path, *(path / left for left, _ in PAIRS)))
    )


def _holds_pictures(folder: Path) -> bool:
    return folder.is_dir() and any(file.suffix.lower() in PICTURE_ENDINGS for file in folder.iterdir())


def find_pictures(path: Path) -> tuple[list[Path], list[Path]]:
    """Left and right picture files; right is empty for monocular pictures. Raises InputError."""
    for left, right in PAIRS:
        if path.is_dir() and _holds_pictures(path / left):
            both = files_of(path / left, PICTURE_ENDINGS), []
            if _holds_pictures(path / right):
                both = both[0], files_of(path / right, PICTURE_ENDINGS)
                check_pairing(*both)
            return both
    sides = _sides(path) if path.is_dir() else None
    return sides if sides else (files_of(path, PICTURE_ENDINGS), [])


def _sides(path: Path) -> tuple[list[Path], list[Path]] | None:
    """The left and the right files of one folder by their names; None unless every name states its side."""
    files = [file for file in visible_files(path) if file.suffix.lower() in PICTURE_ENDINGS]
    found: dict[str, list[Path]] = {"l": [], "r": []}
    for file in files:
        side = SIDE.search(file.stem)
        if side is None:
            return None
        found[(side[1] or side[2])[0].lower()].append(file)
    if not (found["l"] and found["r"]):
        return None
    for one in found.values():
        order = dict(zip(one, frame_numbers(one) or [(SIDE.sub("", file.stem),) for file in one]))
        one.sort(key=lambda file, order=order: order[file])
    left, right = found["l"], found["r"]
    named = frame_numbers(left) is None and frame_numbers(right) is None
    if not named or [SIDE.sub("", file.stem) for file in left] != [SIDE.sub("", file.stem) for file in right]:
        check_pairing(left, right)
    return left, right


def _numbers(files: list[Path]) -> list[int] | None:
    """The single number in the name of every picture; None without."""
    found = frame_numbers(files)
    return None if found is None or len(found[0]) != 1 else [number for (number,) in found]


def _named_times(files: list[Path]) -> NDArray[np.float64] | None:
    """Seconds of pictures whose names are seconds with decimals, as in TUM; None for other names."""
    if len(files) < 2 or not all(re.fullmatch(r"\d+\.\d+", file.stem) for file in files):
        return None
    times = np.array([float(file.stem) for file in files], np.float64)
    return times if (np.diff(times) > 0).all() else None


def _clock(path: Path, files: list[Path], rate: float | None) -> tuple[NDArray[np.float64] | None, PictureTimes]:
    """Seconds of the pictures on a clock of their own: those of a list beside them, or of their names; and the lists.

    rate   stated frame rate, which overrides both
    """
    folders = [folder for folder in (path, files[0].parent) if folder.is_dir()]
    listed = picture_times(folders if path.is_dir() else [], files, rate)
    named = _named_times(files) if rate is None and listed.seconds is None else None
    if named is None:
        return listed.seconds, listed
    said = f"names of the pictures are read as seconds, {named[-1] - named[0]:g} s in all; --source-rate overrides them"
    return named, listed._replace(notes=(*listed.notes, said))


def _in_turn(files: list[Path]) -> list[str]:
    """A note on names that end in two numbers in turn, such as 0007_0 and 0007_1: two cameras may be in one folder."""
    numbers = frame_numbers(files) or []
    last = [number[-1] for number in numbers]
    if not numbers or len(numbers[0]) < 2 or len(files) < 4 or last != (last[:2] * len(last))[: len(last)]:
        return []
    return [
        f"the names end in {last[0]} and {last[1]} in turn ({files[0].name}, {files[1].name}): if these are two"
        " cameras, put their pictures into left/ and right/"
    ]


def describe_pictures(path: Path, options: SourceOptions) -> Clip:
    """The pictures as a clip. Raises InputError."""
    left, right = find_pictures(path)
    if options.right is not None:
        if right:
            raise InputError(f"{path}: has right pictures, and --right names others; use one of them")
        right = files_of(options.right, PICTURE_ENDINGS)
        check_pairing(left, right)
    stereo = "none" if options.stereo == "auto" else options.stereo
    if right and stereo != "none":
        raise InputError(f"{path}: a folder of right pictures and --stereo {stereo}: use one of them")
    width, height = view_size(*size_of(left), stereo)
    camera = stated_camera(options, width, height, path)
    gaps = [found.line for found in gap_findings(left)] + _in_turn(left) + squeezed_note(width, height, stereo)
    clock, lists = _clock(path, left, options.rate)
    times = None if clock is None else clock - clock[0]
    rate = options.rate if clock is None else usual_rate(clock)
    poses, notes = stated_poses(options, len(left), rate, times, _numbers(left), clock)
    return Clip(
        layout="pictures",
        where=path,
        names=[file.stem for file in left],
        pictures=pictures_from_files(left, right, stereo),
        masks=stated_masks(options, left, width, height),
        depth=stated_depth(options, left),
        unit=unit_of(options),
        intrinsics=camera.intrinsics,
        calibration=camera.calibration,
        baseline=camera.baseline,
        poses=poses,
        rate=rate,
        times=times,
        read_here=tuple(
            {file.parent.name.lower() for file in [*left, *right] if file.parent != path}
            | {file.name.lower() for file in [*left, *right] if file.parent == path}
            | set(lists.files)
        ),
        inside=together(folders_of([*left, *right]), {left[0].parent: lists.files}),
        notes=[*picture_notes([*left, *right]), *gaps, *lists.notes, *camera.notes, *notes],
    )


LAYOUT = Layout(
    name="pictures",
    about="a folder of pictures, or left/ and right/",
    rank=9,
    recognises=recognises,
    describe=describe_pictures,
    takes=tuple(name for name in STATEMENTS if name != "orientation"),
    reads=(),
)
