"""Reading and writing of untrusted .npy files: nothing is evaluated or unpickled, and sizes are checked first.

A header must match one regular expression. The file must be a regular file of exactly the length required by dtype and
shape. This package never uses numpy.load.
"""

import math
import os
import re
import stat
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

MAGIC = b"\x93NUMPY"
LONGEST_HEADER = 4096
LARGEST = 1 << 28  # bytes of an array
FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_HEADER = re.compile(
    r"\{'descr': '([<>|=][a-zA-Z]\d{1,3})', 'fortran_order': (True|False), "
    r"'shape': \(((?:\d{1,12}(?:, ?\d{1,12}){0,7})?,?)\),? ?\}\s*"
)


class Refused(Exception):
    """The file is not a plain array; the message gives the reason."""


class Header(NamedTuple):
    """The header of a .npy file."""

    offset: int
    dtype: str
    fortran: bool
    shape: tuple[int, ...]


def header_of(data: bytes) -> Header:
    """Header from the first bytes of a file. Raises Refused."""
    if data[:6] != MAGIC:
        raise Refused("not a .npy file")
    if len(data) < 12 or data[6] not in (1, 2, 3):
        raise Refused("unknown .npy version")
    wide = data[6] > 1
    length = int.from_bytes(data[8 : 12 if wide else 10], "little")
    if length > LONGEST_HEADER:
        raise Refused(f"header of {length} bytes; use at most {LONGEST_HEADER}")
    start = 12 if wide else 10
    raw = data[start : start + length]
    if len(raw) < length:
        raise Refused("file ends inside the header")
    found = _HEADER.fullmatch(raw.decode("latin-1"))
    if not found:
        if b"O'" in raw or b"|O" in raw:
            raise Refused("object array (pickle); use plain numbers")
        raise Refused("header is not that of a plain array")
    shape = tuple(int(n) for n in re.findall(r"\d+", found[3]))
    return Header(start + length, found[1], found[2] == "True", shape)


def read_plain(path: Path, root: Path | None = None, largest: int = LARGEST) -> NDArray:
    """A little-endian, C-order array of at most `largest` bytes. Raises Refused, also for a link or outside `root`."""
    return _with_open(path, root, lambda handle: _read_open(handle, largest))


def read_text(path: Path, root: Path) -> str:
    """A UTF-8 text of at most LONGEST_HEADER bytes, with the same checks. Raises Refused."""

    def read(handle: int) -> str:
        _check_regular(handle)
        data = os.read(handle, LONGEST_HEADER + 1)
        if len(data) > LONGEST_HEADER:
            raise Refused(f"longer than {LONGEST_HEADER} bytes")
        try:
            return data.decode()
        except UnicodeDecodeError:
            raise Refused("not UTF-8 text") from None

    return _with_open(path, root, read)


def _with_open(path: Path, root: Path | None, read: Callable[[int], T]) -> T:
    try:
        if root is not None and not path.resolve().is_relative_to(root.resolve()):
            raise Refused("a link that leaves the folder")
        mode = os.lstat(path).st_mode  # before opening: not every system has the flags
        if stat.S_ISLNK(mode):
            raise Refused("a link; use a regular file")
        if not stat.S_ISREG(mode):
            raise Refused("not a regular file")
        handle = os.open(path, FLAGS)
    except FileNotFoundError:
        raise Refused("missing") from None
    except (OSError, ValueError, RuntimeError) as error:
        raise Refused(f"cannot be opened: {getattr(error, 'strerror', None) or error}") from None
    try:
        return read(handle)
    except OSError as error:
        raise Refused(f"cannot be read: {error.strerror}") from None
    finally:
        os.close(handle)


def _check_regular(handle: int) -> int:
    """Size in bytes."""
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode):
        raise Refused("not a regular file")
    return status.st_size


def _read_open(handle: int, largest: int) -> NDArray:
    size_on_disk = _check_regular(handle)
    with os.fdopen(os.dup(handle), "rb") as file:
        header = header_of(file.read(LONGEST_HEADER + 12))
        order, kind, size = header.dtype[0], header.dtype[1], int(header.dtype[2:])
        if kind not in "fiub" or (kind, size) not in _SIZES:
            raise Refused(f"dtype {header.dtype}; use real, integer or boolean numbers")
        if order == ">" or (order == "=" and np.little_endian is False):
            raise Refused("big-endian; use little-endian")
        if header.fortran and len(header.shape) > 1:
            raise Refused("Fortran order; use C order")
        length = math.prod(header.shape) * size
        if length > largest:
            raise Refused(f"shape {header.shape} has {length} bytes; use at most {largest}")
        if size_on_disk != header.offset + length:
            raise Refused(f"{size_on_disk} bytes; header and shape {header.shape} need {header.offset + length}")
        file.seek(header.offset)
        data = file.read(length)
        if len(data) != length:
            raise Refused("file ended while it was read")
    if kind == "b" and data.strip(b"\0\1"):
        raise Refused("a boolean byte other than 0 and 1")
    return np.frombuffer(data, np.dtype(f"<{kind}{size}")).reshape(header.shape)


_SIZES = {("f", 4), ("f", 8), *((k, s) for k in "iu" for s in (1, 2, 4, 8)), ("b", 1)}


def npy_bytes(array: NDArray) -> bytes:
    """The file of an array: version 1.0, little-endian, C order; equal arrays give equal bytes on every system."""
    kind, size = array.dtype.kind, array.dtype.itemsize
    descr = f"|{kind}1" if size == 1 else f"<{kind}{size}"
    shape = "(" + ", ".join(map(str, array.shape)) + ("," if array.ndim == 1 else "") + ")"
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}"
    text += " " * (-(len(text) + 11) % 64) + "\n"
    data = np.ascontiguousarray(array, np.dtype(descr)).tobytes()
    return MAGIC + b"\x01\x00" + len(text).to_bytes(2, "little") + text.encode("latin-1") + data


def write_npy(path: Path, array: NDArray) -> None:
    """Write `npy_bytes`; creates missing folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(npy_bytes(array))
