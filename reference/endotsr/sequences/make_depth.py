"""`endotsr depth`: depth of every frame of a folder in the common format, from its stereo pairs or from files.

Comes in: the folder; goes out: `depth/` and the section [depth] of its `sequence.toml`, and the coverage of every
frame. The new folder takes its place when it is whole.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.opencv import write_png
from endotsr.sequences.common import Contents, list_contents, open_common
from endotsr.sequences.depth_files import DEPTH_ENDINGS, read_plane
from endotsr.sequences.files import check_pairing, list_pictures
from endotsr.sequences.given_depth import Kind, depth_of_values
from endotsr.sequences.prepare import step_of_depth
from endotsr.sequences.recording import ARBITRARY, PicturePair, Recording
from endotsr.sequences.relative_depth import Align, MadeDepth, flat_depth, relative_depth
from endotsr.sequences.sequence_file import DEPTH, FILE_NAME, Assumed, DepthEntry, SequenceFile, sequence_text
from endotsr.sequences.stereo_depth import StereoSettings, disparity_range, stereo_depth, temporal_median
from endotsr.untrusted.writing import replace_text, replacing_folder

OnFrame = Callable[[int, int], None]


class DepthFrame(NamedTuple):
    """Depth of one frame as it is written."""

    depth: NDArray[np.float32]  # (H, W) 0 = none
    name: str


class DepthReport(NamedTuple):
    """What was written."""

    file: SequenceFile
    coverage: list[float]  # of every frame, fraction of its pixels
    median: float  # of the medians of the frames


def stereo_frames(recording: Recording, settings: StereoSettings) -> Iterator[DepthFrame]:
    """Depth of every frame from its stereo pair. Raises InputError without right pictures or baseline."""
    if recording.lens is None or not recording.baseline:
        raise InputError(
            f"{recording.where}: the baseline is unknown: [camera] baseline is 0 in {FILE_NAME};"
            " allowed: the distance of the two cameras in the unit of the file"
        )
    lens, baseline = recording.lens, recording.baseline
    disparity_range(settings, lens, baseline)
    pairs: list[PicturePair] = []
    depths: list[NDArray[np.float32]] = []
    for i, pair in enumerate(recording.pictures(list(range(recording.count)))):
        if pair.right is None:
            raise InputError(f"{recording.where}: no right pictures (images_right/); allowed: a stereo sequence")
        found = stereo_depth(pair.left, pair.right, lens, baseline, settings).depth
        if not settings.temporal:
            yield DepthFrame(found, recording.names[i])
            continue
        pairs, depths = [*pairs, pair][-3:], [*depths, found][-3:]
        if i:
            middle = len(depths) - 2
            yield DepthFrame(_consistent(depths, pairs, middle), recording.names[i - 1])
    if settings.temporal:
        yield DepthFrame(_consistent(depths[-2:], pairs[-2:], len(depths[-2:]) - 1), recording.names[-1])


def _consistent(depths: list[NDArray[np.float32]], pairs: list[PicturePair], middle: int) -> NDArray[np.float32]:
    return temporal_median(depths, [pair.left for pair in pairs], middle)


def given_frames(contents: Contents, source: Path, kind: Kind, scale: float) -> Iterator[DepthFrame]:
    """Depth of every frame from the files of another program. Raises InputError."""
    files = list_pictures(source, DEPTH_ENDINGS)
    check_pairing(contents.images, files)
    lens = contents.file.camera.lens(contents.folder)
    baseline = contents.file.camera.baseline * contents.file.to_scene(contents.file.unit)
    for image, file in zip(contents.images, files):
        yield DepthFrame(depth_of_values(read_plane(file), kind, scale, lens, baseline, file), image.stem)


def write_depth(
    folder: Path,
    frames: Iterator[DepthFrame],
    method: str,
    replace: bool = False,
    on_frame: OnFrame = lambda i, n: None,
    assumed: Assumed = "",
) -> DepthReport:
    """Write the depth of a sequence and enter it into its `sequence.toml`.

    replace   whether depth that exists may be replaced
    assumed   what is not measured: lengths of the sequence are then in an arbitrary unit

    Raises:  InputError; the folder is as before then.
    """
    contents = list_contents(folder)
    if (contents.file.depth or (folder / DEPTH).exists()) and not replace:
        raise InputError(f"{folder}: has depth already; allowed: --replace")
    coverage, medians, step = [], [], 0.0
    with replacing_folder(folder / DEPTH) as place:
        for k, frame in enumerate(frames):
            known = frame.depth[frame.depth > 0]
            if known.size:
                step = step or step_of_depth(float(np.percentile(known, 99.8)))
                medians.append(float(np.median(known)))
            coverage.append(known.size / frame.depth.size)
            levels = np.rint(frame.depth / (step or 1.0))
            stored = np.where(frame.depth > 0, np.clip(levels, 1, 65535), 0).astype(np.uint16)
            write_png(place / f"{contents.images[k].stem}.png", stored)
            on_frame(k + 1, len(contents.images))
        if not medians:
            raise InputError(f"{folder}: no frame has any depth; is the baseline, the unit or the range wrong?")
    unit = ARBITRARY if contents.file.arbitrary or assumed else "mm"
    entry = DepthEntry(folder=DEPTH, unit=unit, scale=step, method=method, assumed=assumed)
    found = msgspec.structs.replace(contents.file, depth=entry, unit=unit if assumed else contents.file.unit)
    replace_text(folder / FILE_NAME, sequence_text(found))
    return DepthReport(found, coverage, float(np.median(medians)))


def make_stereo_depth(
    folder: Path, settings: StereoSettings, replace: bool, on_frame: OnFrame = lambda i, n: None
) -> DepthReport:
    """Depth from the stereo pairs of a folder. Raises InputError."""
    smooth = " and weighted least squares" if settings.smooth else ""
    method = f"semi-global matching, left-right check{smooth}{', median along the flow' if settings.temporal else ''}"
    return write_depth(folder, stereo_frames(open_common(folder), settings), method, replace, on_frame)


def take_given_depth(
    folder: Path, source: Path, kind: Kind, scale: float, replace: bool, on_frame: OnFrame = lambda i, n: None
) -> DepthReport:
    """Depth from the files of another program. Raises InputError."""
    frames = given_frames(list_contents(folder), source, kind, scale)
    return write_depth(folder, frames, f"{kind} from {source.name}", replace, on_frame)


def take_made_depth(folder: Path, made: MadeDepth, replace: bool, on_frame: OnFrame = lambda i, n: None) -> DepthReport:
    """Depth of `relative_depth`. Raises InputError."""
    names = [image.stem for image in list_contents(folder).images]
    frames = (DepthFrame(plane, name) for plane, name in zip(made.frames, names))
    return write_depth(folder, frames, made.method, replace, on_frame, made.assumed)


def make_flat_depth(folder: Path, replace: bool, on_frame: OnFrame = lambda i, n: None) -> DepthReport:
    """A plane in every frame. Raises InputError."""
    return take_made_depth(folder, flat_depth(list_contents(folder)), replace, on_frame)


def take_relative_depth(
    folder: Path,
    source: Path,
    align: Align,
    farthest: float,
    trusted: bool,
    replace: bool,
    on_frame: OnFrame = lambda i, n: None,
) -> DepthReport:
    """Depth from the relative inverse depth of a network; see `relative_depth`. Raises InputError."""
    contents = list_contents(folder)
    if contents.depth and not replace:
        raise InputError(
            f"{folder}: has depth already; allowed: --replace, which takes scale and shift from it and fills the rest"
        )
    return take_made_depth(folder, relative_depth(contents, source, align, farthest, trusted), replace, on_frame)
