"""The one place that imports OpenCV: on first use, so that commands which read no picture start without it."""

import os
from functools import cache
from typing import Any

from endotsr.untrusted.files import MOST_PIXELS

SILENT = 0  # LOG_LEVEL_SILENT, which the Python module of OpenCV 4 does not name


@cache
def cv2_library() -> Any:
    """The module `cv2`, which decodes no picture of more than 2^26 pixels unless it was imported before."""
    # These are read when the library is loaded.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # AV_LOG_QUIET: what it prints names no file
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
    import cv2

    # Its messages on standard error name no file, and every failed call raises or returns nothing.
    if hasattr(cv2, "setLogLevel"):  # OpenCV 4
        cv2.setLogLevel(SILENT)  # pyright: ignore[reportAttributeAccessIssue]
    else:  # OpenCV 5
        cv2.utils.logging.setLogLevel(SILENT)
    return cv2
