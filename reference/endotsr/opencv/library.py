"""The one place that imports OpenCV: on first use, so that commands which read no picture start without it."""

from functools import cache
from typing import Any

SILENT = 0  # LOG_LEVEL_SILENT, which the Python module of OpenCV 4 does not name


@cache
def cv2_library() -> Any:
    """The module `cv2`."""
    import cv2

    # Its messages on standard error name no file, and every failed call raises or returns nothing.
    if hasattr(cv2, "setLogLevel"):  # OpenCV 4
        cv2.setLogLevel(SILENT)  # pyright: ignore[reportAttributeAccessIssue]
    else:  # OpenCV 5
        cv2.utils.logging.setLogLevel(SILENT)
    return cv2
