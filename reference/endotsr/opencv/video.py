"""Video files: the writing of a film. `sequences.video_file` reads them."""

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import Array
from endotsr.opencv.library import cv2_library


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
