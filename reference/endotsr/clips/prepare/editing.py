"""Editing a clip before it is written: frame selection by number or time, pairing of views, cropping, union of masks.

In: a `Clip` and option values. Out: frame numbers, or an edited `Clip`.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.sequences.checks.late import lag_in_words
from endotsr.clips.sequences.clip import Clip, Masks, Picture, PicturePair
from endotsr.clips.sequences.crop import crop_within
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import stated_masks
from endotsr.clips.sequences.splits import parse_frame_range
from endotsr.clips.sequences.times import evenly_spaced
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.names import counted

SECONDS = re.compile(r"(\d|\.)\s*s\b")
ALLOWED = "use frames A:B[:S] or N, seconds As:Bs, several with commas, such as 0:10,12,30s:45s"


def chosen_frames(text: str, clip: Clip, option: str = "--frames") -> list[int]:
    """The frames of a list such as `0:10,12,2.5s:8s`, ascending and unique; "" selects all.

    Numbers follow Python's slices; negative ones count from the end. Seconds count from the first frame. The end is
    exclusive.

    option   named in messages

    Raises:  InputError for a part that is invalid, selects nothing, or is outside the clip.
    """
    if not text.strip():
        return list(range(clip.count))
    found: set[int] = set()
    for part in text.split(","):
        try:
            frames = _seconds(part.strip(), clip) if SECONDS.search(part) else _numbers(part.strip(), clip.count)
        except InputError as error:
            raise InputError(f"{option} {error}") from None
        if not frames:
            raise InputError(f"{option} {part.strip()!r}: selects nothing of {clip.count} frames; {ALLOWED}")
        found.update(frames)
    return sorted(found)


def without(frames: list[int], text: str, clip: Clip) -> list[int]:
    """The frames that are not in a list as in `chosen_frames`. Raises InputError."""
    dropped = set(chosen_frames(text, clip, "--drop")) if text.strip() else set()
    return [i for i in frames if i not in dropped]


def _numbers(part: str, count: int) -> list[int]:
    """The frames of a slice, or the frame of a number. The messages begin with the part, without the option."""
    try:
        number = int(part)
    except ValueError:
        try:
            return [*parse_frame_range(part, count, 0)] if part else []
        except InputError as error:
            raise InputError(f"{str(error).removeprefix('frames ')}; {ALLOWED}") from None
    if not -count <= number < count:
        raise InputError(f"{part!r}: {number} is outside the {counted(count, 'frame')} of the source")
    return [number % count]


def _seconds(part: str, clip: Clip) -> list[int]:
    """The frames of a time span such as `2.5s:8s`. The messages begin with the part, without the option."""
    if clip.times is None and not clip.rate:
        raise InputError(f"{part!r}: the frame rate is unknown; use {_stated_rate(clip)} with seconds")
    words = part.split(":")
    try:
        bounds = [float(word.removesuffix("s")) if word.strip() else None for word in words]
    except ValueError:
        bounds = []
    if len(bounds) != 2 or any(word.strip() and not word.strip().endswith("s") for word in words):
        raise InputError(f"{part!r}: no span of seconds; {ALLOWED}")
    if any(bound is not None and bound < 0 for bound in bounds):
        raise InputError(f"{part!r}: seconds count from the first frame; use numbers from 0")
    first, last = -np.inf if bounds[0] is None else bounds[0], np.inf if bounds[1] is None else bounds[1]
    times = clip.times_of(range(clip.count))
    elapsed: FloatArray = times - times[0]
    if np.isfinite(last) and last > elapsed[-1] + 1.5 / (clip.rate or 1.0):
        raise InputError(f"{part!r}: the source ends after {elapsed[-1]:.3f} seconds")
    return np.flatnonzero((elapsed >= first - 1e-9) & (elapsed < last - 1e-9)).tolist()


def _stated_rate(clip: Clip) -> str:
    """Where a user states the frame rate of a clip."""
    if clip.layout == "servct":
        return "a recording, which separate pairs are not,"
    return f"frame_rate in {clip.stated_in}" if clip.layout == "common" else "--source-rate HZ"


def thinned(clip: Clip, frames: list[int], rate: float | None, notes: list[str]) -> list[int]:
    """The frames nearest to the times of a lower frame rate; all frames without a rate. Raises InputError."""
    if not frames:
        raise InputError(f"{clip.where}: no frame is left")
    if rate is None:
        return frames
    if clip.rate is None:
        raise InputError(f"{clip.where}: the frame rate is unknown; use {_stated_rate(clip)} with --rate")
    if rate > clip.rate:
        raise InputError(f"rate {rate:g}: the source has {clip.rate:g} frames per second; use no more")
    times = clip.times_of(frames)
    wanted = times[0] + np.arange(int((times[-1] - times[0]) * rate + 1e-6) + 1) / rate
    kept = np.unique(_nearest(times, wanted))
    notes.append(f"{len(kept)} of {len(frames)} frames kept for {rate:g} a second, by their times")
    return [frames[k] for k in kept]


def _nearest(times: FloatArray, wanted: FloatArray) -> NDArray[np.intp]:
    """For each wanted time the number of the nearest of the ascending times; of two equally near ones, the earlier."""
    after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    before, after = after - 1, np.minimum(after, len(times) - 1)
    nearer = np.abs(times[after] - wanted + 1e-9) < np.abs(times[before] - wanted + 1e-9)
    return np.where(nearer, after, before)


def written_times(
    clip: Clip, frames: list[int], rate: float | None, notes: list[str]
) -> tuple[list[float] | None, float]:
    """The times for `sequence.toml`, None for evenly spaced frames, and the frame rate; 0 if it is unknown.

    rate     the requested frame rate, or None. Evenly spaced frames have it, or else, without gaps, that of the source;
             others have their mean rate
    """
    times = clip.times_of(frames)
    if len(frames) < 2:
        return None, float(clip.rate or 0.0)
    mean = (len(frames) - 1) / float(times[-1] - times[0])
    whole = clip.rate and frames == list(range(frames[0], frames[-1] + 1))
    known = clip.rate or clip.times is not None
    even = evenly_spaced(times)
    stated = float(rate if rate and even else clip.rate if whole and even and clip.rate else mean)
    if even:
        return None, stated if known else 0.0
    steps, unit = np.diff(times), "s" if known else "frames"
    notes.append(
        f"the frames are not evenly spaced ({steps.min():.3g} to {steps.max():.3g} {unit} apart): sequence.toml states"
        " their times, and a training uses them"
    )
    return [round(float(s), 6) for s in times - times[0]], stated if known else 0.0


def _within(window: tuple[int, ...], camera: Intrinsics) -> Intrinsics:
    """The intrinsics of a window of the pictures."""
    x, y, width, height = window
    return camera._replace(cx=camera.cx - x, cy=camera.cy - y, width=width, height=height)


def cropped(clip: Clip, window: tuple[int, ...]) -> Clip:
    """The clip cropped to a window x, y, width, height of its pictures, with the principal point shifted.

    Raises:  InputError for an empty window. A window beyond the pictures, and a picture or depth of another size than
             the camera, are refused when they are read.
    """
    camera = clip.calibration.left if clip.calibration else clip.intrinsics
    crop = crop_within(window, camera, clip.crop)
    x, y, width, height = window

    def cut(plane: NDArray, what: str, i: int) -> NDArray:
        size, part = plane.shape[1::-1], plane[y : y + height, x : x + width]
        said = f"{what} of {size[0]}x{size[1]} pixels"
        if camera and size != (camera.width, camera.height):
            other = f"{camera.width}x{camera.height}"
            raise InputError(f"{clip.where}: frame {clip.names[i]}: {said}, the camera is of {other}; use one size")
        if part.shape[:2] != (height, width):
            raise InputError(f"{clip.where}: --crop {x} {y} {width} {height} leaves the {said}")
        return np.ascontiguousarray(part)

    def part(read: Callable[[int], NDArray | None], what: str, i: int) -> NDArray | None:
        plane = read(i)
        return None if plane is None else cut(plane, what, i)

    def pictures(wanted: list[int]) -> Iterator[PicturePair]:
        for i, pair in zip(wanted, clip.pictures(wanted)):
            left, right = cut(pair.left, "pictures", i), pair.right
            yield PicturePair(left, None if right is None else cut(right, "pictures", i))

    masks, depth, calibration = clip.masks, clip.depth, clip.calibration
    intrinsics = partial(_within, window)
    return replace(
        clip,
        pictures=pictures,
        crop=crop,
        masks=None if masks is None else replace(masks, read=partial(part, masks.read, "masks"), files=[]),
        depth=None if depth is None else replace(depth, read=partial(part, depth.read, "depth"), files=[]),
        intrinsics=None if clip.intrinsics is None else intrinsics(clip.intrinsics),
        calibration=calibration
        and calibration._replace(left=intrinsics(calibration.left), right=intrinsics(calibration.right)),
        notes=[*clip.notes, f"cropped to {width}x{height} pixels from ({x}, {y}); the intrinsics follow"],
    )


def paired_by_time(clip: Clip, late: int) -> Clip:
    """The clip with the left picture of frame i beside the right one of frame i + late, for a view that lags.

    late     frames of the source by which the right view is late; negative: early

    Edges:   a frame whose partner is outside the clip has no pictures; `with_partner` omits it.
    Raises:  InputError for a lag as long as the clip. A clip without right pictures is refused when one is read.
    """
    _refuse_long_lag(clip, late, "--right-late")

    def pictures(wanted: list[int]) -> Iterator[PicturePair]:
        left: dict[int, Picture] = {}  # of wanted frames whose partner is still to come, and the other way round
        right: dict[int, Picture] = {}
        owners, waiting = set(wanted), iter(wanted)
        turn = next(waiting, None)
        needed = sorted(owners | {i + late for i in wanted})
        for i, pair in zip(needed, clip.pictures(needed)):
            if pair.right is None:
                raise InputError(f"{clip.where}: no right pictures; --right-late is allowed for a stereo clip alone")
            if i in owners:
                left[i] = pair.left
            if i - late in owners:
                right[i - late] = pair.right
            while turn in left and turn in right:
                yield PicturePair(left.pop(turn), right.pop(turn))
                turn = next(waiting, None)

    note = f"right view taken as {lag_in_words(late)}: frame i is paired with right picture i {late:+d}"
    return replace(clip, pictures=pictures, right=[], notes=[*clip.notes, note])


def masks_by_time(clip: Clip, late: int) -> Clip:
    """The clip with the mask i + late for frame i, for masks that lag; `late` as in `paired_by_time`.

    Edges:   a frame whose mask is outside the clip has none; `with_partner` omits it.
    Raises:  InputError for a clip without masks, and for a lag as long as the clip.
    """
    masks = clip.masks
    if masks is None:
        raise InputError(f"{clip.where}: no masks; --masks-late is allowed for a clip with masks alone")
    _refuse_long_lag(clip, late, "--masks-late")
    read = lambda i: masks(i + late) if 0 <= i + late < clip.count else None
    note = f"masks taken as {lag_in_words(late)}: frame i has mask i {late:+d}"
    return replace(clip, masks=replace(masks, read=read, files=[], levels=None), notes=[*clip.notes, note])


def _refuse_long_lag(clip: Clip, late: int, option: str) -> None:
    if abs(late) >= clip.count:
        raise InputError(
            f"{option} {late}: use -{clip.count - 1} to {clip.count - 1} for {counted(clip.count, 'frame')}"
        )


def with_partner(clip: Clip, frames: list[int], late: int, what: str, notes: list[str]) -> list[int]:
    """The frames whose partner, that of frame i + late, is in the clip. The others are noted.

    what   the partner in words: `a right picture` or `a mask`
    """
    kept = [i for i in frames if 0 <= i + late < clip.count]
    if len(kept) < len(frames):
        notes.append(f"{counted(len(frames) - len(kept), 'frame')} without {what} of their moment omitted")
    return kept


def united(clip: Clip, folders: tuple[Path, ...], options: SourceOptions) -> Clip:
    """The clip with a union of masks: a pixel that its own or any folder's mask excludes is excluded.

    Raises:  InputError as `stated_masks`, or for unknown intrinsics.
    """
    intrinsics = clip.intrinsics or (clip.calibration.left if clip.calibration else None)
    if intrinsics is None:
        raise InputError(f"{clip.where}: the intrinsics are unknown; use --camera, --calibration or --field-of-view")
    frames = [clip.where / f"{name}.png" for name in clip.names]
    more = [
        stated_masks(replace(options, masks=folder), frames, intrinsics.width, intrinsics.height, clip.source_names)
        for folder in folders
    ]
    every = [mask for mask in (clip.masks, *more) if mask is not None]

    def mask(i: int) -> NDArray[np.bool_] | None:
        planes = [plane for plane in (one(i) for one in every) if plane is not None]
        return np.logical_and.reduce(planes) if len(planes) == len(every) else None

    names = ", ".join(folder.name for folder in folders)
    return replace(
        clip,
        masks=Masks(
            mask,
            proposed=any(one.proposed for one in every),
            origin="; ".join([*(one.origin for one in every if one.origin), f"united with {names}"]),
        ),
        notes=[*clip.notes, f"masks: united with {names}", *(one.paired for one in every if one.paired)],
    )
