"""Arrays from .npy and .npz files: plain numbers only, no pickled objects, no more memory than the caller allows.

A header whose size contradicts that of the file or entry is refused before its array is allocated. Entries of an .npz
must be uncompressed unless the caller allows compression: without compression, an array needs no more bytes than its
file has; with it, at most the limit of the caller.
"""

import ast
import io
import math
import re
import zipfile
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.untrusted.files import open_regular
from endotsr.untrusted.names import plain_line

LONGEST_HEADER = 4096  # bytes of the header of an array
WRITTEN_BY_PYTHON_2 = re.compile(r"(?<=\d)L\b")  # after an integer
MOST_AXES = 8
NUMBERS = "biuf"  # NumPy kinds: Boolean, signed, unsigned and floating-point numbers
DAMAGE = (zipfile.BadZipFile, zlib.error, OSError, EOFError, ValueError, NotImplementedError, RuntimeError, KeyError)


class RefusedArray(ValueError):
    """The data is not an array of plain numbers; the message states the reason."""


def read_npy(path: Path, largest: int) -> NDArray:
    """The array of an .npy file. Raises InputError for anything but one array of plain numbers."""
    with open_regular(path, largest) as file:
        length = file.seek(0, io.SEEK_END)
        file.seek(0)
        try:
            return array_from(file, length)
        except (RefusedArray, OSError) as error:
            raise InputError(f"{path}: not a plain NumPy array file: {error}") from None


def array_from(file: io.BufferedIOBase, length: int) -> NDArray:
    """One array in .npy format that fills the next `length` bytes of a stream, its last ones. Raises RefusedArray."""
    shape, fortran, dtype, start = _header(file)
    size = math.prod(shape) * dtype.itemsize
    if size != length - start:
        raise RefusedArray(f"shape {shape} of {dtype.str} needs {size} bytes, the file has {length - start}")
    data = bytearray(size)
    if file.readinto(data) != size or file.read(1):
        raise RefusedArray("the data ends early")
    try:
        return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
    except ValueError as error:  # a side of 0 beside sides beyond NumPy's
        raise RefusedArray(plain_line(str(error))) from None


def _header(file: io.BufferedIOBase) -> tuple[tuple[int, ...], bool, np.dtype, int]:
    """Shape, order and dtype from the header of an array, and the length of the header in bytes."""
    start = file.read(8)
    if start[:6] != npy.MAGIC_PREFIX:
        raise RefusedArray("not an .npy file")
    wide = start[6:7] in (b"\x02", b"\x03")
    if start[6:] not in (b"\x01\x00", b"\x02\x00", b"\x03\x00"):
        raise RefusedArray("unknown version of the .npy format")
    prefix = file.read(4 if wide else 2)
    length = int.from_bytes(prefix, "little")
    if length > LONGEST_HEADER:
        raise RefusedArray(f"its header has {length} bytes; use at most {LONGEST_HEADER}")
    shape, fortran, dtype = _entries(file.read(length).decode("latin-1"))
    if dtype.hasobject:
        raise RefusedArray("it holds Python objects; use numbers, as numpy.stack makes of arrays of one size")
    if (
        dtype.kind not in NUMBERS
        or dtype.itemsize > 8
        or dtype.shape
        or len(shape) > MOST_AXES
        or min(shape, default=0) < 0
    ):
        raise RefusedArray(f"{dtype} {shape}; use plain numbers of at most 8 bytes, with {MOST_AXES} axes or fewer")
    return shape, fortran, dtype, len(start) + len(prefix) + length


def _entries(header: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and dtype from the text of a header, which is a Python literal.

    NumPy's own reader tokenises an invalid header, which takes seconds for 4096 bytes.
    """
    try:
        found = ast.literal_eval(WRITTEN_BY_PYTHON_2.sub("", header).strip())
        shape, fortran, name = (found[key] for key in ("shape", "fortran_order", "descr"))
        dtype = np.dtype(name)
    except Exception as error:  # any error that the literal or a dtype name causes
        raise RefusedArray(f"its header cannot be read: {plain_line(str(error)) or 'damaged'}") from None
    if not isinstance(shape, tuple) or any(type(side) is not int for side in shape) or type(fortran) is not bool:
        raise RefusedArray("its header cannot be read: use a shape of integers, and an order that is true or false")
    return shape, fortran, dtype


class NpzFile:
    """The arrays of an open .npz file, read one at a time. Created by `open_npz`."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}

    @property
    def names(self) -> list[str]:
        """Array names, in file order."""
        return list(self._entries)

    def read(self, name: str) -> NDArray:
        """One of the `names`, its checksum verified. Raises RefusedArray; KeyError for another name."""
        entry = self._entries[name]
        try:
            with self._archive.open(entry) as stream:
                return array_from(stream, entry.file_size)  # type: ignore[arg-type]  # a ZipExtFile
        except RefusedArray:
            raise
        except DAMAGE as error:
            raise RefusedArray(str(error).splitlines()[0] if str(error) else "damaged") from None


@contextmanager
def open_npz(path: Path, largest: int, *, compressed: bool = False) -> Iterator[NpzFile]:
    """An .npz file, opened for reading.

    largest      upper limit in bytes, for the file and for the sum of its arrays
    compressed   allow compressed entries

    Raises: InputError if it is not an .npz file, if two entries have one name (with or without `.npy`), if an entry is
            encrypted, compressed without permission or other than by deflate, or states another size than it has, or
            if the arrays together exceed `largest`.
    """
    with open_regular(path, largest) as file:
        try:
            archive = zipfile.ZipFile(file)
        except DAMAGE as error:
            raise InputError(f"{path}: not an .npz file, or cut short: {error}") from None
        with archive:
            _check_entries(path, archive.infolist(), largest, compressed)
            yield NpzFile(archive)


def read_npz(path: Path, names: Collection[str], largest: int) -> dict[str, NDArray]:
    """The arrays with these names; missing ones are omitted. Compression is allowed.

    Raises: InputError as `open_npz` does, and for an array that is damaged or is not plain numbers, naming it.
    """
    found, name = {}, ""
    with open_npz(path, largest, compressed=True) as file:
        try:
            for name in names:
                if name in file.names:
                    found[name] = file.read(name)
        except RefusedArray as error:
            raise InputError(f"{path}: {name}: {error}") from None
    return found


def _check_entries(path: Path, entries: list[zipfile.ZipInfo], largest: int, compressed: bool) -> None:
    names = [entry.filename.removesuffix(".npy") for entry in entries]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: an entry is listed twice; use every array once")
    if sum(entry.file_size for entry in entries) > largest:
        raise InputError(f"{path}: its arrays have more than {largest} bytes together; use at most {largest}")
    for entry in entries:
        if entry.flag_bits & 1 or (entry.compress_type != zipfile.ZIP_STORED and not compressed):
            raise InputError(f"{path}: an entry is compressed or encrypted; use arrays as `numpy.savez` stores them")
        if entry.compress_type == zipfile.ZIP_STORED and entry.compress_size != entry.file_size:
            raise InputError(f"{path}: damaged: an entry states {entry.file_size} bytes and has {entry.compress_size}")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{path}: an entry is compressed in an unknown way; use the compression of `numpy.savez`")
