"""Arrays over all frames of a clip, in memory or in a file.

A clip that needs more than half of `sequence.memory` is stored in an unnamed file in the folder for temporary files
(TMPDIR, by default /tmp). The system pages it in and out as memory allows, and removes it when the process ends, even
after a crash. The values are identical in both cases.

In: the memory limit and the size of the clip. Out: arrays of zeros, and a note if they are in a file.
"""

import os
import shutil
import tempfile

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.errors import InputError
from endotsr.method.kernels.memory import memory_limit, unknown_memory
from endotsr.untrusted.names import counted

PIXEL_BYTES = 3 + 1 + 4 + 1  # image, mask, depth, and the stored mask during reading


class FrameStore:
    """The arrays of one clip."""

    def __init__(self, count: int, width: int, height: int, memory: float, where: object) -> None:
        """Choose between memory and a file.

        memory  `sequence.memory`, GB; 0 = half of this machine's (of 4 GB if the system does not report it)

        Raises:  InputError, before anything is read, if the clip fits neither in memory nor on disk.
        """
        self.needed = count * width * height * PIXEL_BYTES
        self.in_file = self.needed > memory_limit(memory) / 2
        self._unknown = unknown_memory() if self.in_file and not memory > 0 else ""
        self._what = f"{where}: {counted(count, 'frame')} of {width}x{height} need {self.needed / 1e9:.1f} GB"
        free = shutil.disk_usage(tempfile.gettempdir()).free
        if self.in_file and self.needed > free:
            raise InputError(
                f"{self._what}, more than half of the allowed memory, and {tempfile.gettempdir()} has"
                f" {free / 1e9:.1f} GB; use fewer --frames, smaller pictures (endotsr prepare --scale), or a"
                f" larger disk (TMPDIR){self._remedy}"
            )

    @property
    def note(self) -> str:
        """Where the arrays are stored; "" if they are in memory."""
        if not self.in_file:
            return ""
        return (
            f"frames: {self.needed / 1e9:.2g} GB, more than half of sequence.memory, are stored in an unnamed file in"
            f" {tempfile.gettempdir()}, which ends with this process{self._remedy}"
        )

    @property
    def _remedy(self) -> str:
        """The setting for a system that does not report its memory."""
        return f"; {self._unknown}; sequence.memory states it" if self._unknown else ""

    def array(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray:
        """An array of zeros. Raises InputError if the disk is full."""
        if not self.in_file:
            return np.zeros(shape, dtype)
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        try:
            with tempfile.TemporaryFile(prefix="endotsr-frames-") as file:
                if hasattr(os, "posix_fallocate"):  # a full disk is an error here instead of a signal later
                    os.posix_fallocate(file.fileno(), 0, size)
                return np.asarray(np.memmap(file, np.dtype(dtype), "w+", shape=shape))
        except OSError as error:
            raise InputError(f"{self._what}: no file for them in {tempfile.gettempdir()}: {error.strerror}") from None
