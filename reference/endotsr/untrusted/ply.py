"""The vertices of PLY files: ASCII, little-endian and big-endian, with any properties that are plain numbers.

The header is checked against the size of the file before the vertices are allocated. Elements behind the vertices, such
as faces, are not read.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.names import plain_line

# Name of a type in the header -> the type without its byte order.
TYPES = {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8", "uchar": "u1", "uint8": "u1", "char": "i1",
         "int8": "i1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4",
         "uint": "u4", "uint32": "u4"}  # fmt: skip
FORMS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
END = b"\nend_header"
LONGEST_HEADER = 1 << 20  # bytes


class Vertices(NamedTuple):
    """The first element of a file."""

    values: NDArray[np.void]  # (n,) records
    others: list[str]  # names of the elements behind it


def read_vertices(path: Path, largest: int) -> Vertices:
    """The vertices of a file, whose first element is `vertex`.

    largest   of the file, bytes

    Raises:  InputError naming the file and the reason.
    """
    content = read_bytes(path, largest)
    try:
        return _vertices(content)
    except ValueError as error:
        raise InputError(f"{path}: cannot be read: {plain_line(str(error))}") from None


def _vertices(content: bytes) -> Vertices:
    """As `read_vertices`. Raises ValueError."""
    form, elements, body = _header(content)
    (name, count, properties), *others = elements
    if name != "vertex" or count < 1:
        raise ValueError("the first element is not `vertex` with a count")
    if any(kind not in TYPES for _, kind in properties):
        raise ValueError("a vertex property is not a plain number")
    names = [name for name, _ in properties]
    if len(set(names)) < len(names) or not names:
        raise ValueError("no vertex property, or two with the same name")
    kind = np.dtype([(name, FORMS[form] + TYPES[stored]) for name, stored in properties])
    width = 2 * len(names) if form == "ascii" else kind.itemsize
    if len(body) < count * width - (form == "ascii"):
        raise ValueError(f"{count} vertices of {width} bytes expected, {len(body)} bytes found")
    if form != "ascii":
        return Vertices(np.frombuffer(body, kind, count=count), [other[0] for other in others])
    return Vertices(_from_text(body, kind, count), [other[0] for other in others])


def _from_text(body: bytes, kind: np.dtype, count: int) -> NDArray[np.void]:
    """The vertices of an ASCII file, one per line."""
    lines = [line for line in body.decode("ascii", "replace").splitlines() if line.strip()][:count]
    rows = [line.split() for line in lines]
    width = len(kind.names or ())
    if len(rows) < count or any(len(row) != width for row in rows):
        raise ValueError(f"{count} lines of {width} numbers expected")
    numbers = np.array(rows, np.float64)
    values = np.empty(count, kind)
    for k, name in enumerate(kind.names or ()):
        values[name] = numbers[:, k]
    return values


def _header(content: bytes) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]], bytes]:
    """Form, elements (name, count, properties with their types) and the rest of the file."""
    end = content.find(END, 0, LONGEST_HEADER)
    body = content.find(b"\n", end + 1) + 1  # behind the mark, which may end with a carriage return too
    lines = [line.split() for line in content[: max(end, 0)].decode("ascii", "replace").splitlines()]
    form = next((line[1] for line in lines if line[:1] == ["format"] and len(line) == 3), "")
    if end < 0 or body == 0 or lines[:1] != [["ply"]] or form not in FORMS:
        raise ValueError(f"not a PLY file in one of the forms {', '.join(FORMS)}")
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    for line in lines:
        if line[:1] == ["element"]:
            if len(line) != 3 or not line[2].isdecimal():
                raise ValueError("an element is not a name with a count")
            elements.append((line[1], int(line[2]), []))
        elif line[:1] == ["property"]:
            if len(line) < 3 or not elements:
                raise ValueError("a property without an element, a type or a name")
            elements[-1][2].append((line[-1], line[1] if len(line) == 3 else "list"))
    if not elements:
        raise ValueError("the first element is not `vertex` with a count")
    return form, elements, content[body:]
