"""MAT-files of MATLAB, version 5: numbers, texts, structs and cells as plain values.

SciPy parses the file. Before that, it is unpacked here up to a size, and `matlab_elements` checks it: a hostile file
may claim any size and depth. Objects of MATLAB's classes have a form that is not public, and version 7.3 is HDF5: both
are refused with the command that exports them.
"""

import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.json import Keys
from endotsr.untrusted.matlab_elements import COMPRESSED, DEEPEST, HEADER, Order, check_elements, elements
from endotsr.untrusted.names import plain_line

LARGEST_FILE = 1 << 30  # bytes, unpacked
SAVE = "save it in MATLAB with save('FILE.mat', ..., '-v7')"
EXPORT = "s = toStruct(OBJECT); save('FILE.mat', '-struct', 's', '-v7') in MATLAB stores it as plain values"


def read_mat(path: Path, largest: int = LARGEST_FILE) -> Keys:
    """The variables of a file. A struct is a mapping, several structs and a cell are lists, 1x1 is a number.

    Other numbers are an array without axes of length 1, so a row and a column have one axis. Cells of several columns
    are listed row by row. Of a text with several rows, the first one is kept.

    largest   size limit of the unpacked file, bytes

    Raises:  InputError for a file of another version, a damaged or oversized one, complex and sparse arrays, functions,
             and objects of classes.
    """
    data = _unpacked(path, largest)
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    try:
        found = loadmat(io.BytesIO(data), simplify_cells=False, verify_compressed_data_integrity=True)
    except Exception as error:  # SciPy passes on any error of its parser
        raise InputError(f"{path}: damaged MAT-file: {plain_line(str(error))}") from None
    for name, value in found.items():
        if isinstance(value, MatlabOpaque):
            opaque = value.ravel()[0]
            kind, name = _name(opaque["s2"]), _name(opaque["s0"]) or name
            raise InputError(f"{path}: {name} is an object of the class {kind}, which MATLAB alone reads; {EXPORT}")
        if isinstance(value, MatlabFunction):
            raise InputError(f"{path}: {plain_line(name)} is a function; use numbers and structs")
    return {name: _plain(value, f"{path}: {name}", 0) for name, value in found.items() if not name.startswith("__")}


def _name(word: Any) -> str:
    return plain_line(word.decode("latin-1") if isinstance(word, bytes) else str(word))[:60]


def _plain(value: Any, where: str, depth: int) -> Any:
    """A value as mappings, lists, arrays, numbers and texts. Raises InputError for anything else."""
    if depth > DEEPEST or not isinstance(value, np.ndarray | np.void):
        raise InputError(f"{where}: holds neither numbers nor texts; use plain values: {EXPORT}")
    if isinstance(value, np.void):
        return {name: _plain(value[name], f"{where}.{name}", depth + 1) for name in value.dtype.names or ()}
    if value.dtype.names:
        structs = [_plain(one, where, depth + 1) for one in value.ravel()]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        return [_plain(one, where, depth + 1) for one in value.ravel()]
    if value.dtype.kind == "U":
        return str(value.ravel()[0]) if value.size else ""
    if value.dtype.kind not in "fiub":
        raise InputError(f"{where}: {value.dtype} is not supported; use real numbers")
    return _number(value.ravel()[0].item()) if value.size == 1 else np.squeeze(value)


def _number(value: float) -> float | int:
    """The number, as an integer if it is whole: MATLAB stores whole numbers as doubles."""
    return int(value) if float(value).is_integer() else value


def _unpacked(path: Path, largest: int) -> bytes:
    """The file with every compressed element unpacked. Raises InputError for another version, and beyond `largest`."""
    data = read_bytes(path, largest)
    if data[:10] == b"MATLAB 7.3" or b"\x89HDF\r\n\x1a\n" in data[:1024]:
        raise InputError(f"{path}: a MAT-file of version 7.3 (HDF5) is not read; {SAVE}")
    if len(data) < HEADER or data[126:128] not in (b"IM", b"MI"):
        raise InputError(f"{path}: not a MAT-file of version 5; {SAVE}")
    order: Order = "little" if data[126:128] == b"IM" else "big"
    parts, size, place = [data[:HEADER]], HEADER, HEADER
    for element in elements(data, HEADER, len(data), order):
        part, place = data[place : element.after], element.after
        if element.kind == COMPRESSED:
            try:
                part = zlib.decompressobj().decompress(data[element.start : element.end], largest - size + 1)
            except zlib.error as error:
                raise InputError(f"{path}: damaged MAT-file: {error}") from None
        size += len(part)
        if size > largest:
            raise InputError(f"{path}: more than {largest} bytes when unpacked; use a smaller file")
        parts.append(part)
    whole = b"".join([*parts, data[place:]])
    check_elements(whole, order, path)
    return whole
