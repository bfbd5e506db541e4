"""Video files: what a file holds, its pictures in order, and the writing of a film.

Comes in: a path and the numbers of the wanted pictures, ascending; goes out: RGB pictures one by one. A video is
decoded from its start: seeking by number is inexact for most codecs.
"""

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.kernels.arrays import Array
from endotsr.opencv.library import cv2_library
from endotsr.untrusted.files import open_regular

LARGEST_FILE = 1 << 40  # bytes: a video is decoded picture by picture
# First bytes of the containers: the ending of a name says nothing of what a decoder would do with a play list.
STARTS = {
    0: (b"RIFF", b"\x1aE\xdf\xa3", b"\0\0\1", b"G", b"0&\xb2u"),  # avi, mkv and webm, mpeg, ts, wmv
    4: (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot"),  # mp4 and mov
}
VIDEO_ENDINGS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv")


class VideoFacts(NamedTuple):
    """What the header of a video says. The number of pictures is an estimate in some containers."""

    width: int
    height: int
    count: int
    rate: float | None  # pictures a second


def video_facts(path: Path) -> VideoFacts:
    """Size, number and rate of the pictures. Raises InputError if the file is no video that OpenCV decodes."""
    cv2 = cv2_library()
    capture = _opened(path)
    try:
        width, height, count = (
            int(capture.get(key))
            for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_COUNT)
        )
        rate = float(capture.get(cv2.CAP_PROP_FPS))
    finally:
        capture.release()
    if width < 1 or height < 1 or count < 1:
        raise InputError(f"{path}: holds no pictures that can be decoded ({count} of {width}x{height})")
    return VideoFacts(width, height, count, rate if np.isfinite(rate) and rate > 0 else None)


def video_pictures(path: Path, wanted: list[int]) -> Iterator[NDArray[np.uint8]]:
    """The pictures with these numbers, ascending, from 0: (H, W, 3) RGB each.

    Raises:  InputError naming the picture at which the video ends too early.
    """
    capture = _opened(path)
    try:
        position = 0
        for number in wanted:
            while position < number:
                if not capture.grab():
                    raise _ended(path, position)
                position += 1
            done, picture = capture.read()
            if not done:
                raise _ended(path, position)
            position += 1
            yield np.ascontiguousarray(picture[:, :, ::-1])
    finally:
        capture.release()


def _opened(path: Path):
    with open_regular(Path(path), LARGEST_FILE) as file:
        begin = file.read(16)
    if not any(begin.startswith(starts, place) for place, starts in STARTS.items()):
        raise InputError(f"{path}: not a video by its first bytes; allowed: {', '.join(VIDEO_ENDINGS)}")
    capture = cv2_library().VideoCapture(str(path))
    if not capture.isOpened():
        raise InputError(f"{path}: not a video that OpenCV can decode; allowed: {', '.join(VIDEO_ENDINGS)}")
    return capture


def _ended(path: Path, position: int) -> InputError:
    return InputError(f"{path}: the video ends after {position} pictures: it is truncated or damaged")


def write_video(path: Path, pictures: Iterable[Array], rate: float, lossless: bool = False) -> None:
    """Write a film in the VP9 format; the ending of the name, .mp4 or .webm, chooses the container.

    pictures  (H, W, 3) uint8 RGB, all of one size with even sides
    rate      pictures a second
    lossless  PNG pictures in place of VP9: `video_pictures` returns the same pictures; few players show such a film
    Raises:   InputError if there is no picture, or if this build of OpenCV cannot encode the format.
    """
    code = "png " if lossless else "vp09"  # of the lossless formats, OpenCV 4 and 5 both put this one into .mp4
    cv2, writer = cv2_library(), None
    try:
        for picture in pictures:
            if writer is None:
                height, width = picture.shape[:2]
                with _silent():  # the library warns of a tag that a webm file does not hold
                    writer = cv2.VideoWriter(
                        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), float(rate), (width, height)
                    )
                if not writer.isOpened():
                    raise InputError(f"{path}: this build of OpenCV cannot encode the film; allowed: a name in .gif")
            writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
    finally:
        if writer is not None:
            writer.release()
    if writer is None:
        raise InputError(f"{path}: a film needs a picture")


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Nothing is written to the standard error of the process, by libraries in C either, during the block."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
