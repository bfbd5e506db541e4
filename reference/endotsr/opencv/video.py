"""Video files: what a file holds, and its pictures in order.

Comes in: a path and the numbers of the wanted pictures, ascending; goes out: RGB pictures one by one. A video is
decoded from its start: seeking by number is inexact for most codecs.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.opencv.library import cv2_library

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
    if not Path(path).is_file():
        raise InputError(f"{path}: file not found")
    capture = cv2_library().VideoCapture(str(path))
    if not capture.isOpened():
        raise InputError(f"{path}: not a video that OpenCV can decode; allowed: {', '.join(VIDEO_ENDINGS)}")
    return capture


def _ended(path: Path, position: int) -> InputError:
    return InputError(f"{path}: the video ends after {position} pictures: it is truncated or damaged")
