"""Reading video files: properties, the time of every picture, and the pictures in order.

In: a path and the numbers of the wanted pictures, ascending. Out: RGB pictures, one at a time. FFmpeg decodes them
through PyAV, which only this module and `film_file` import. A video is decoded from its start, because seeking by
number is inexact for most codecs. Interlaced pictures are deinterlaced (bwdif): the rows of the first field are kept,
and the rows of the second are interpolated. A stated rotation is reported, not applied.
"""

import contextlib
import itertools
import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.clocks import Clock, clock_of
from endotsr.clips.formats.video_marks import container_notes, without_index
from endotsr.clips.formats.view_marks import ViewMarks, view_marks
from endotsr.errors import InputError
from endotsr.untrusted.files import MOST_PIXELS, open_regular
from endotsr.untrusted.names import choice, plain_line

LARGEST_FILE = 1 << 40  # bytes; a video is decoded picture by picture
# First bytes of the containers. The extension is not sufficient: a decoder would follow a play list.
STARTS = {
    # avi, mkv and webm, mpeg and vob, raw H.264, ts, wmv, flv, mxf, dv
    0: (b"RIFF", b"\x1aE\xdf\xa3", b"\0\0\1", b"\0\0\0\1", b"G", b"0&\xb2u", b"FLV", b"\x06\x0e+4", b"\x1f\x07\0"),
    4: (b"G", b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot"),  # m2ts; mp4 and mov
}
VIDEO_ENDINGS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv")
HIDDEN = ("vp8",)  # codecs with packets without a visible picture; pictures are counted by decoding
# Transfer functions that are not display-referred.
WIDE_RANGE = {8: "linear light", 9: "logarithm", 10: "logarithm", 16: "PQ", 18: "HLG"}
BT2020 = 9  # of the primaries
UNSTATED, HIGH_DEFINITION = 2, 576  # colour matrix not stated; rows above which players assume BT.709
MOST_DECODED = 5000  # pictures of the longest file that is decoded for its time stamps in any case
LENGTH = re.compile(r"(\d{1,4}):(\d\d):(\d\d(?:\.\d+)?)")  # a tag of Matroska: hours, minutes, seconds
MISSING, MISSING_STEPS = 0.01, 3  # of the stated length, and times between two pictures, that may be missing
PROBED = 3  # pictures decoded to find properties that are missing in the header


class VideoFacts(NamedTuple):
    """Properties of a video, for the pictures and not the sound."""

    width: int  # as stored
    height: int
    count: int
    clock: Clock  # times and rate of the pictures
    turn: int  # counter-clockwise rotation by a player, degrees: 0, 90, 180 or 270
    interlaced: bool
    codec: str
    pixel_shape: float  # width / height of a pixel
    remarks: tuple[str, ...] = ()  # further remarks, in words
    views: ViewMarks = ViewMarks()

    @property
    def times(self) -> NDArray[np.float64] | None:
        """(count,) seconds from the first picture, ascending; None: unknown."""
        return self.clock.times


def is_video(path: Path) -> bool:
    """Whether a file is a video by its ending, or by its first bytes; a file that is not a regular one is none."""
    if not path.is_file():
        return False
    if path.suffix.lower() in VIDEO_ENDINGS:
        return True
    try:
        with open_regular(path, LARGEST_FILE) as file:
            begin = file.read(189)
    except (OSError, InputError):
        return False
    if begin.startswith(b"RIFF"):
        return begin[8:12] == b"AVI "  # other files, such as WebP, begin alike
    if begin.startswith(b"G"):
        return begin[188:] == b"G"  # packets of a transport stream
    return any(begin.startswith(starts, place) for place, starts in STARTS.items())


def video_facts(path: Path) -> VideoFacts:
    """Size, number, times and kind of the pictures.

    Raises:  InputError for a file that is not a decodable video, and for high dynamic range.
    """
    noted = [note.removeprefix(f"{path.name}: ") for note in container_notes(path)]
    with _opened(path) as (container, stream):
        codec, context = stream.codec_context.name, stream.codec_context
        shape = float(stream.sample_aspect_ratio or 1) or 1.0
        ends = _stated_end(container, stream)
        stated, rate = int(stream.frames or 0), float(stream.average_rate or 0)
        first = list(itertools.islice(_decoded(container.decode(stream), path), PROBED))
        if not first:
            raise InputError(
                f"{path}: holds no pictures that can be decoded ({codec} {context.width}x{context.height})"
            )
        _refuse_wide_range(first[0], path)
        width, height, turn = first[0].width, first[0].height, round(first[0].rotation) % 360
        interlaced = any(frame.interlaced_frame for frame in first)
        remarks = (*noted, *_remarks(first[0], len(container.streams.video)))
        views = view_marks(first[0], path)
    packets = _packets(path)
    if len(packets) < stated:
        raise InputError(
            f"{path}: the video ends after {len(packets)} of {stated} pictures: it is truncated or damaged; use a"
            f" whole file (`ffmpeg -i {path.name} -c copy whole{path.suffix}` keeps what is left)"
        )
    stamps, hidden = _stamps(path, packets, by_decoding=interlaced or codec in HIDDEN)
    early = "" if stated else _ends_early(stamps, ends)
    remarks = (*remarks, *filter(None, (hidden, early)))
    if turn % 90:
        raise InputError(f"{path}: the file states a rotation of {turn} degrees; use 0, 90, 180 and 270")
    clock = clock_of(stamps, rate if np.isfinite(rate) and rate > 0 else None)
    return VideoFacts(width, height, len(stamps), clock, turn, interlaced, codec, shape, remarks, views)


def _stated_end(container: Any, stream: Any) -> float:
    """Second of the clock of the file at which the pictures end by its header; 0: unknown.

    Matroska and WebM state no number of pictures, but a length of the stream as a tag, or of the file alone. The latter
    counts only for a file without sound, which may last longer.
    """
    stated = LENGTH.fullmatch(str(stream.metadata.get("DURATION", "")))
    if stated:
        hours, minutes, seconds = map(float, stated.groups())
        return 3600 * hours + 60 * minutes + seconds
    alone = "matroska" in container.format.name and len(container.streams) == 1
    return (container.duration or 0) / 1e6 if alone else 0.0


def _ends_early(stamps: NDArray[np.float64], stated: float) -> str:
    """A remark on pictures that end long before the stated end, as in an interrupted copy of Matroska or WebM.

    stamps   (n,) seconds of the pictures, NaN where unknown
    stated   of the same clock, which need not begin at 0; 0: unknown
    """
    if len(stamps) < 2 or not np.isfinite(stamps).all():
        return ""
    step = float(np.median(np.diff(np.sort(stamps))))
    end = float(stamps.max()) + step
    if stated - end <= max(MISSING * stated, MISSING_STEPS * step):
        return ""
    return f"states {stated:.4g} seconds, but its pictures end after {end:.4g}: it is truncated; copy it again"


def _remarks(frame: Any, streams: int) -> tuple[str, ...]:
    """Remarks on properties that the file leaves open or that are ignored."""
    found = []
    if streams > 1:
        found.append(f"{streams} video streams: one is read; for a stereo pair, export each stream as a separate file")
    if any(part.is_alpha for part in frame.format.components):
        found.append("its transparency is ignored")
    if int(frame.colorspace) == UNSTATED and not frame.format.is_rgb and frame.height > HIGH_DEFINITION:
        found.append("states no colour matrix: BT.601 is assumed, but players assume BT.709 at this size")
    if int(frame.color_primaries or 0) == BT2020:
        found.append("states BT.2020 colours: its values are read as sRGB")
    return tuple(found)


def _refuse_wide_range(frame: Any, path: Path) -> None:
    """Raises InputError for pictures that are not display RGB."""
    kind = WIDE_RANGE.get(int(frame.color_trc or 0))
    if kind:
        raise InputError(
            f"{path}: pictures of high dynamic range ({kind}); use display RGB, for example after a tone mapping"
            " by the program that exported the video"
        )


class _Packet(NamedTuple):
    """A coded picture of a file."""

    stamp: int | None  # of its display, or else of its decoding
    order: int | None  # of its decoding
    whole: bool  # a picture by itself, and not damaged
    shown: bool  # an edit list may hide the lead-in of a cut


def _packets(path: Path) -> list[_Packet]:
    """The coded pictures, hidden ones included."""
    with _opened(path) as (container, stream):
        found = [
            _Packet(p.pts if p.pts is not None else p.dts, p.dts, p.is_keyframe and not p.is_corrupt, not p.is_discard)
            for p in _decoded(container.demux(stream), path)
            if p.size
        ]
    return found


def _stamps(path: Path, packets: list[_Packet], by_decoding: bool) -> tuple[NDArray[np.float64], str]:
    """Seconds of every picture that is shown, in this order, NaN where unknown; and a remark on lost pictures.

    A packet that cannot be decoded is no picture. Long files are decoded for their stamps if they begin inside a group
    of pictures, or their clock goes back.
    """
    shown = [packet for packet in packets if packet.shown]
    order = [packet.order for packet in shown if packet.order is not None]
    doubtful = len(shown) <= MOST_DECODED or not shown[0].whole or any(a >= b for a, b in pairwise(order))
    stamps: list[int | None] = []
    with _opened(path) as (container, stream):
        step = float(stream.time_base or 0)
        if by_decoding or doubtful:
            stream.thread_type = "AUTO"
            with contextlib.suppress(InputError):  # the reader of the pictures names the damaged one
                stamps = [frame.pts for frame in _decoded(container.decode(stream), path)]
    if not stamps:
        known = sorted(packet.stamp for packet in shown if packet.stamp is not None)
        stamps = [*known, *[None] * (len(shown) - len(known))]
    lost = 0 if by_decoding else len(shown) - len(stamps)
    remark = f"{lost} of {len(shown)} coded pictures cannot be decoded and are left out" if lost > 0 else ""
    return np.array([np.nan if stamp is None else stamp * step for stamp in stamps], np.float64), remark


def video_pictures(path: Path, wanted: list[int]) -> Iterator[NDArray[np.uint8]]:
    """The pictures with these numbers, ascending from 0: (H, W, 3) RGB, as stored (not rotated), deinterlaced.

    Raises:  InputError naming a picture that is damaged, has another size, or is missing at the end.
    """
    with _opened(path) as (container, stream):
        stream.thread_type = "AUTO"
        pictures = enumerate(_decoded(_progressive(_decoded(container.decode(stream), path)), path))
        size, position = None, -1
        for number in wanted:
            while position < number:
                position, frame = next(pictures, (position, None))
                if frame is None:
                    raise InputError(
                        f"{path}: the video ends after {position + 1} pictures: it is truncated or damaged"
                    )
                if frame.is_corrupt:
                    raise InputError(f"{path}: picture {position} is damaged; use a whole file, or other --frames")
            size = size or (frame.width, frame.height)
            if (frame.width, frame.height) != size:
                raise InputError(
                    f"{path}: picture {position}: {frame.width}x{frame.height} pixels, those before have"
                    f" {size[0]}x{size[1]}; use one size"
                )
            yield _as_rgb(frame, path, position)


def _as_rgb(frame: Any, path: Path, position: int) -> NDArray[np.uint8]:
    """The picture (H, W, 3). Raises InputError for marks of colour or pixels that FFmpeg cannot convert."""
    import av.error

    try:
        return np.ascontiguousarray(frame.to_ndarray(format="rgb24", interpolation="BICUBIC"))
    except (av.error.FFmpegError, ValueError, MemoryError) as error:
        said = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: picture {position} cannot be converted to RGB: {plain_line(said)}") from None


def _progressive(frames: Iterable[Any]) -> Iterator[Any]:
    """The frames, deinterlaced from the first interlaced one on. Progressive frames pass unchanged."""
    graph = None
    for frame in frames:
        if graph is None and frame.interlaced_frame:
            graph = _deinterlacer(frame)
        if graph is None:
            yield frame
        else:
            graph.push(frame)
            yield from _pulled(graph)
    if graph is not None:
        graph.push(None)
        yield from _pulled(graph)


def _deinterlacer(frame: Any) -> Any:
    """A filter graph that converts interlaced frames like this one into as many progressive frames."""
    import av.filter

    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format.name, time_base=frame.time_base
    )
    filter_ = graph.add("bwdif", "mode=send_frame:parity=auto:deint=interlaced")
    sink = graph.add("buffersink")
    source.link_to(filter_)
    filter_.link_to(sink)
    graph.configure()
    return graph


def _pulled(graph: Any) -> Iterator[Any]:
    """All available output frames of a filter graph."""
    import av.error

    while True:
        try:
            yield graph.pull()
        except (av.error.BlockingIOError, av.error.EOFError):
            return


def _decoded(items: Iterator[Any], path: Path) -> Iterator[Any]:
    """The items of a decoder. Its errors become an InputError that names the picture."""
    import av.error

    position = 0
    try:
        for item in items:
            yield item
            position += 1
    except InputError:
        raise  # of a decoder among the items
    except av.error.EOFError:
        return
    except (av.error.FFmpegError, ValueError, MemoryError) as error:
        raise InputError(f"{path}: cannot be decoded at picture {position}: {plain_line(str(error))}") from None


def _metadata_ignored(version: str) -> dict[str, str]:
    """The option for files whose metadata are not UTF-8. PyAV from version 19 on needs none."""
    return {} if int(version.split(".")[0]) >= 19 else {"metadata_errors": "ignore"}


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """The container and its best video stream. The decoder opens no other file. Raises InputError."""
    import av
    import av.error

    path = Path(path)
    with open_regular(path, LARGEST_FILE) as file:
        begin = file.read(16)
        if not any(begin.startswith(starts, place) for place, starts in STARTS.items()):
            raise InputError(f"{path}: not a video by its first bytes; use {choice(VIDEO_ENDINGS)}")
        file.seek(0)
        try:
            options: Any = _metadata_ignored(av.__version__)
            container = av.open(file, "r", **options)
        except (av.error.FFmpegError, ValueError, MemoryError) as error:
            said = getattr(error, "strerror", None) or str(error)  # without the number of the open file
            lost = without_index(path)
            raise InputError(f"{path}: not a video that can be decoded: {plain_line(said)}{lost}") from None
        with container:
            stream: Any = container.streams.best("video")
            if stream is None or stream.codec_context is None:
                raise InputError(f"{path}: holds no pictures of a known codec{without_index(path)}")
            if stream.codec_context.width * stream.codec_context.height > MOST_PIXELS:
                size = f"{stream.codec_context.width}x{stream.codec_context.height}"
                raise InputError(f"{path}: pictures of {size} pixels; use at most {MOST_PIXELS}")
            stream.codec_context.options = {"max_pixels": str(MOST_PIXELS)}
            yield container, stream
