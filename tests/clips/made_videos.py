"""Folders of pictures, and videos with real codecs, as cameras leave them: interlaced, uneven in time, turned."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import write_png

WIDTH, HEIGHT = 128, 96
CAMERA = ("--camera", "100", "100", "64", "48")
Picture = NDArray[np.uint8]


def picture(i: float, width: int = WIDTH, height: int = HEIGHT) -> Picture:
    """Reddish tissue whose pattern moves to the left; the upper left corner is bright, so that a turn is seen."""
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    red = 150 + 60 * np.sin(x / 7 + 0.3 * i) * np.cos(y / 9)
    made = np.stack([red, 70 + 20 * np.cos(y / 8), np.full_like(red, 60.0)], axis=2)
    made[:12, :20] = 230
    return made.astype(np.uint8)


def pictures(count: int = 12) -> list[Picture]:
    return [picture(i) for i in range(count)]


def woven(count: int = 12) -> list[Picture]:
    """Interlaced frames: the even rows of moment 2 i, the odd rows of moment 2 i + 1."""
    found = []
    for i in range(count):
        frame = picture(2 * i)
        frame[1::2] = picture(2 * i + 1)[1::2]
        found.append(frame)
    return found


def files(folder: Path, name: str, frames, ending: str = "png") -> None:
    """Pictures, masks or depth in a folder: 0000.png, 0001.png, ...; ending: png, jpg or npy."""
    writers = {"png": write_png, "jpg": write_jpeg, "npy": np.save}
    (folder / name).mkdir(parents=True)
    for i, frame in enumerate(frames):
        writers[ending](folder / name / f"{i:04d}.{ending}", frame)


@contextmanager
def own_scheduling() -> Iterator[None]:
    """Take back the real-time scheduling class that the encoder SVT-AV1 gives to the thread of its caller.

    It does so where the user may (root in a container), and each process that the tests start later would inherit it.
    """
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def write(path: Path, frames: list[Picture], codec: str = "libx264", rate: int = 25, milliseconds=None, **more) -> Path:
    """A video.

    milliseconds  of every frame; None: evenly spaced at `rate`
    more          `options` of the encoder, those of the `container`, `layout` (pixel format), `shape` (of a pixel),
                  `transfer` (function), `primaries` (of colour),
                  `stereo_mode` (of Matroska), `matrix` of the colours, `colorspace` (its mark)
    """
    with own_scheduling(), av.open(str(path), "w", options=more.get("container") or {}) as container:
        stream = container.add_stream(codec, rate=1000 if milliseconds else rate, options=more.get("options") or {})
        stream.width, stream.height = frames[0].shape[1], frames[0].shape[0]
        stream.pix_fmt = more.get("layout") or "yuv420p"
        if "shape" in more:
            stream.codec_context.sample_aspect_ratio = more["shape"]
        if more.get("stereo_mode"):
            stream.metadata["stereo_mode"] = more["stereo_mode"]
        if "colorspace" in more:
            stream.codec_context.colorspace = more["colorspace"]
        if "primaries" in more:
            stream.codec_context.color_primaries = more["primaries"]
        if "transfer" in more:
            stream.codec_context.color_trc = more["transfer"]
        for i, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            if "matrix" in more:
                frame = frame.reformat(format=stream.pix_fmt, dst_colorspace=more["matrix"])
            if milliseconds:
                frame.pts, frame.time_base = milliseconds[i], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


INTERLACED = {
    "H.264": ("a.mp4", "libx264", {"flags": "+ildct+ilme", "x264-params": "interlaced=1:tff=1"}),
    "MPEG-2": ("a.mpg", "mpeg2video", {"flags": "+ildct+ilme", "b": "4000000"}),
    "MPEG-4": ("a.avi", "mpeg4", {"flags": "+ildct+ilme", "b": "4000000"}),
    "MPEG-2 transport stream": ("a.ts", "mpeg2video", {"flags": "+ildct+ilme", "b": "4000000"}),
}
UNEVEN = (0, 33, 67, 100, 500, 533, 567, 1200, 1233, 1267, 1300, 1333)  # ms


def turn(path: Path, degrees: int) -> Path:
    """Change the matrix of the track of an mp4 file: players turn the pictures clockwise by 90, 180 or 270 degrees."""
    cosine, sine = {90: (0, 1), 180: (-1, 0), 270: (0, -1)}[degrees]
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 4 + 40  # version 0: the matrix follows 40 bytes of times, layer and volume
    matrix = [cosine, sine, 0, -sine, cosine, 0, 0, 0]
    data[place : place + 32] = b"".join((value << 16).to_bytes(4, "big", signed=True) for value in matrix)
    path.write_bytes(data)
    return path
