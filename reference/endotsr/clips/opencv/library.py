"""The only import of OpenCV, on first use: commands that read no picture start without it."""

import os
from functools import cache
from typing import Any

from endotsr.untrusted.files import MOST_PIXELS

SILENT = 0  # LOG_LEVEL_SILENT, which the Python module of OpenCV 4 does not export


@cache
def cv2_library() -> Any:
    """The module `cv2`. It decodes no picture of more than 2^26 pixels, unless it was imported earlier."""
    # The library reads these variables when it is loaded.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # AV_LOG_QUIET: its messages name no file
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
    # An idle thread of its pool would yield 2000 times after every call, on a core that the kernels use.
    os.environ.setdefault("OPENCV_THREAD_POOL_ACTIVE_WAIT_WORKER", "0")
    import cv2

    # Its messages on standard error name no file, and every failed call raises or returns nothing.
    if hasattr(cv2, "setLogLevel"):  # OpenCV 4
        cv2.setLogLevel(SILENT)  # pyright: ignore[reportAttributeAccessIssue]
    else:  # OpenCV 5
        cv2.utils.logging.setLogLevel(SILENT)
    return cv2
