"""Writing video files: H.264 in .mp4 if FFmpeg has an encoder, otherwise VP9. `video_file` reads them.

In: pictures of one size. Out: one video file, encoded by FFmpeg through PyAV. Browsers, PowerPoint and QuickTime play
H.264; browsers play VP9. The file states BT.709 colours with the BT.601 matrix, which players apply at every picture
size.
"""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array

BT709, BT601, LIMITED = 1, 6, 1  # primaries and transfer function; matrix; range, as FFmpeg numbers them
MOST_DENOMINATOR = 1001  # of a frame rate as a fraction; television has 30000/1001


class Encoder(NamedTuple):
    """An FFmpeg encoder with its options."""

    name: str
    options: dict[str, str]
    pixels: str = "yuv420p"


# Macroblock trees of libx264 (FFmpeg 8.1) seem to read memory that is not set where the width is no multiple of 32
# pixels: in a trial the same pictures gave 20 different files in 24 repetitions, and one without them. A film of 60
# frames of EndoNeRF cutting was 7 % larger without them.
H264 = (
    Encoder("libx264", {"crf": "17", "preset": "medium", "x264-params": "mbtree=0"}),
    Encoder("h264_videotoolbox", {"q:v": "70"}),  # macOS
    Encoder("h264_mf", {"quality": "90"}),  # Windows
    Encoder("libopenh264", {"b": "12M"}),
)
VP9 = (Encoder("libvpx-vp9", {"crf": "24", "b": "0", "cpu-used": "3", "row-mt": "1"}),)
LOSSLESS = (Encoder("png", {}, "rgb24"),)
BY_ENDING = {".mp4": (*H264, *VP9), ".webm": VP9}


def encoder_of(path: Path, lossless: bool = False) -> Encoder:
    """The first available encoder for an .mp4 or .webm file. Raises InputError if this build of FFmpeg has none."""
    from av.codec import codecs_available

    wanted = LOSSLESS if lossless else BY_ENDING[Path(path).suffix.lower()]
    found = next((encoder for encoder in wanted if encoder.name in codecs_available and _encodes(encoder.name)), None)
    if found is None:
        names = ", ".join(encoder.name for encoder in wanted)
        raise InputError(f"{path}: this build of FFmpeg has no encoder for it ({names}); use a name in .gif")
    return found


def write_video(path: Path, pictures: Iterable[Array], rate: float, lossless: bool = False, comment: str = "") -> None:
    """Write a video file. The extension, .mp4 or .webm, selects the container.

    pictures  (H, W, 3) uint8 RGB, all of one size with even sides
    rate      pictures per second
    lossless  PNG pictures, which `video_pictures` returns exactly; few players support them
    comment   that the file states
    Raises:   InputError without pictures or without an encoder for the format; OSError of the file system.
    """
    import av
    import av.error

    encoder, stream = encoder_of(path, lossless), None
    options = {"movflags": "faststart"} if path.suffix.lower() == ".mp4" else {}  # plays while it loads
    try:
        with av.open(str(path), mode="w", options=options) as container:
            if comment:
                container.metadata["comment"] = comment
            for picture in pictures:
                stream = stream or _stream(container, encoder, picture, rate)
                frame: Any = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
                container.mux(stream.encode(frame.reformat(format=encoder.pixels)))
            if stream is None:
                raise InputError(f"{path}: a film needs a picture")
            container.mux(stream.encode())
    except av.error.FFmpegError as error:
        if isinstance(error, OSError) and error.errno:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise InputError(f"{path}: {encoder.name} cannot encode the film: {error}; use a name in .gif") from None


def _stream(container: Any, encoder: Encoder, picture: Array, rate: float) -> Any:
    """The video stream of a container, for pictures of the size of this one."""
    stream = container.add_stream(
        encoder.name, rate=Fraction(rate).limit_denominator(MOST_DENOMINATOR), options=dict(encoder.options)
    )
    stream.height, stream.width = picture.shape[:2]
    stream.pix_fmt = encoder.pixels
    if encoder.pixels != "rgb24":
        context = stream.codec_context
        context.color_primaries, context.color_trc, context.colorspace = BT709, BT709, BT601
        context.color_range = LIMITED
    return stream


def _encodes(name: str) -> bool:
    """Whether FFmpeg can encode with this codec."""
    from av.codec import Codec
    from av.codec.codec import UnknownCodecError

    try:
        Codec(name, "w")
    except UnknownCodecError:
        return False
    return True
