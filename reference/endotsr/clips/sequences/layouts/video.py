"""A video file: one picture per frame, or stereo pairs side by side, stacked, or in a second video.

A folder with two videos whose names state their sides, such as left.mp4 and right.mp4, is a pair as well.
"""

from collections.abc import Iterator
from functools import partial
from itertools import repeat
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import visible_files
from endotsr.clips.formats.video_file import VideoFacts, is_video, video_facts, video_pictures
from endotsr.clips.formats.view_marks import chosen_views
from endotsr.clips.sequences.clip import Clip, Picture, PicturePair
from endotsr.clips.sequences.layouts import STATEMENTS, Layout
from endotsr.clips.sequences.layouts.pictures import SIDE
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import stated_camera, stated_depth, stated_masks, stated_poses, unit_of
from endotsr.clips.sequences.stored_pairs import SQUEEZED, split_pair, squeezed_note, view_size
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

SAME_RATE = 0.01  # relative difference of the frame rates of two videos of a pair


def recognises(path: Path) -> bool:
    """Whether a path is a video, or a folder with one of the left and one of the right camera."""
    return is_video(path) or _sides(path) is not None


def _sides(path: Path) -> tuple[Path, Path] | None:
    """The left and the right video of a folder; None unless it has two videos whose names state their sides."""
    files = [file for file in visible_files(path) if is_video(file)] if path.is_dir() else []
    found = {(side[1] or side[2])[0].lower(): file for file in files if (side := SIDE.search(file.stem))}
    return (found["l"], found["r"]) if len(files) == 2 and set(found) == {"l", "r"} else None


def describe_video(path: Path, options: SourceOptions) -> Clip:
    """The video as a clip. Raises InputError."""
    sides = _sides(path)
    path, right = _left_and_right(path, sides, options)
    facts = video_facts(path)
    quarters = _quarter_turns(facts, options, path)
    across, down = (facts.width, facts.height) if quarters % 2 == 0 else (facts.height, facts.width)
    stereo, right_first, views = chosen_views(facts.views, "none" if right else options.stereo, path, facts.pixel_shape)
    width, height = view_size(across, down, stereo)
    if right is not None:
        _check_right(facts, video_facts(right), path, right)
    rate, times = _clock(facts, options, path)
    camera = stated_camera(options, width, height, path)
    notes = (
        _notes(facts, rate, path, stereo)
        + views
        + squeezed_note(width, height, stereo)
        + _turn_notes(facts, quarters, options, path)
    )
    poses, note = stated_poses(options, facts.count, rate, times)
    return Clip(
        layout="video",
        where=path,
        names=[f"{i:06d}" for i in range(facts.count)],
        pictures=partial(_pictures, path, right, quarters, stereo, right_first),
        masks=stated_masks(options, facts.count, width, height),
        depth=stated_depth(options, facts.count),
        unit=unit_of(options),
        intrinsics=camera.intrinsics,
        calibration=camera.calibration,
        baseline=camera.baseline,
        poses=poses,
        rate=rate,
        times=times,
        read_here=tuple(file.name.lower() for file in sides or ()),
        notes=[*notes, *camera.notes, *note],
    )


def _left_and_right(path: Path, sides: tuple[Path, Path] | None, options: SourceOptions) -> tuple[Path, Path | None]:
    """The video and that of the right view, if there is one. Raises InputError if the options state both otherwise."""
    if sides and options.right is not None:
        raise InputError(f"{path}: has a right video, and --right names another; use one of them")
    path, right = sides or (path, options.right)
    if right is not None and options.stereo not in ("auto", "none"):
        raise InputError(f"{path}: two videos of a pair and --stereo {options.stereo}; use one of them")
    return path, right


def _pictures(
    path: Path, right: Path | None, quarters: int, stereo: str, right_first: bool, wanted: list[int]
) -> Iterator[PicturePair]:
    """The pictures of these frames, turned and divided, or with those of a second video."""
    others = video_pictures(right, wanted) if right else repeat(None)
    for i, picture, other in zip(wanted, video_pictures(path, wanted), others):
        turned: Picture = np.ascontiguousarray(np.rot90(picture, quarters))
        if other is None:
            pair = split_pair(turned, stereo, f"{path}: picture {i}")
            yield PicturePair(pair.right, pair.left) if right_first and pair.right is not None else pair
        else:
            yield PicturePair(turned, np.ascontiguousarray(np.rot90(other, quarters)))


def _check_right(left: VideoFacts, right: VideoFacts, path: Path, other: Path) -> None:
    """Raises InputError unless the pictures of two videos are pairs."""
    rates = [facts.clock.rate or 0.0 for facts in (left, right)]
    compared = [(name, getattr(left, name), getattr(right, name))
                for name in ("count", "width", "height", "turn", "interlaced")]  # fmt: skip
    if abs(rates[1] - rates[0]) > SAME_RATE * rates[0]:
        compared.append(("pictures a second", rates[0], rates[1]))
    for name, here, there in compared:
        if here != there:
            said = f"{name} {there:g}, of {path.name} {here:g}"
            raise InputError(f"{other}: {said}; use the right view of each picture")


def _clock(facts: VideoFacts, options: SourceOptions, path: Path) -> tuple[float | None, NDArray[np.float64] | None]:
    """Rate and times of the pictures. Raises InputError for a clock that cannot be, without --source-rate."""
    if options.rate:
        return options.rate, None
    if not facts.clock.stands:
        raise InputError(
            f"{path}: {facts.clock.remark}, and the jump is longer than all pictures together; use --source-rate"
            " HZ (evenly spaced), or a file cut there"
        )
    return facts.clock.rate, facts.clock.times


def _turn_notes(facts: VideoFacts, quarters: int, options: SourceOptions, path: Path) -> list[str]:
    """The note on a stated rotation, or on --orientation without one."""
    if facts.views.mirrored:
        return [f"{path.name} states mirrored pictures: used as stored; intrinsics, masks and depth refer to these"]
    if facts.turn:
        done = f"rotated by {facts.turn} degrees counter-clockwise" if quarters else "used as stored"
        return [f"{path.name} states a rotation: pictures {done}; intrinsics, masks and depth refer to these"]
    if options.orientation is not None:
        return [f"{path.name} states no rotation: --orientation {options.orientation} changes nothing"]
    return []


def _quarter_turns(facts: VideoFacts, options: SourceOptions, path: Path) -> int:
    """Counter-clockwise quarter turns to apply. Raises InputError for a stated rotation without --orientation."""
    if facts.views.mirrored and options.orientation != "stored":
        raise InputError(
            f"{path}: the file states that its pictures are shown mirrored; use --orientation stored (as the"
            " sensor wrote them), or a file that stores them as they are to be read"
        )
    if facts.turn and options.orientation is None:
        raise InputError(
            f"{path}: the file states that its pictures are shown rotated by {facts.turn} degrees counter-clockwise;"
            " intrinsics, masks and depth fit only one of the two: use --orientation turned (as players and ffmpeg"
            " show them) or --orientation stored (as the sensor wrote them)"
        )
    return facts.turn // 90 if options.orientation == "turned" else 0


def _notes(facts: VideoFacts, rate: float | None, path: Path, stereo: str) -> list[str]:
    found = [
        f"{path.name}: {counted(facts.count, 'picture')} of {facts.width}x{facts.height}, {facts.codec},"
        f" {rate or 0:g} a second"
    ]
    found += [f"{path.name}: {remark}" for remark in facts.remarks]
    if facts.interlaced:
        found.append(f"{path.name} is interlaced: deinterlaced to one picture per two fields (bwdif)")
    _, across, down = SQUEEZED.get(stereo, (stereo, 1, 1))
    shape = facts.pixel_shape * down / across
    if abs(shape - 1) > 1e-6:
        found.append(f"{path.name}: pixels are {shape:.4g} times as wide as high, as are fx and fy")
    if facts.clock.remark:
        found.append(f"{path.name}: {facts.clock.remark}")
    elif facts.clock.times is None:
        found.append(f"{path.name} states no times: frames count as evenly spaced")
    return found


LAYOUT = Layout(
    name="video",
    about="a video file",
    rank=5,
    recognises=recognises,
    describe=describe_video,
    takes=STATEMENTS,
)
