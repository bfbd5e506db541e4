"""The one place that imports OpenCV: on first use, so that commands which read no picture start without it."""

from functools import cache
from typing import Any


@cache
def cv2_library() -> Any:
    """The module `cv2`."""
    import cv2

    # Its messages on standard error name no file, and every failed call raises or returns nothing.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    return cv2
