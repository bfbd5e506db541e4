"""The elements of a MAT-file of version 5, checked before a parser sees them.

SciPy trusts the kind, the number and the lengths of the elements of an array: a wrong one ends the process. Here an
array is refused unless it has the elements of its class and they fill it.
"""

import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Literal, NamedTuple

from endotsr.errors import InputError

Order = Literal["little", "big"]
HEADER, TAG = 128, 8  # bytes before the first element, and of the tag of an element
TEXT, LENGTHS, UNSIGNED, MATRIX, COMPRESSED = 1, 5, 6, 14, 15  # kinds of elements
NUMBERS = (1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18)  # kinds of those with numbers or text
CELL, STRUCT, OBJECT, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 5, 16, 17  # classes of arrays
PLAIN = (4, *range(6, 16))  # classes of text and numbers
COMPLEX = 0x800  # a flag beside the class
DEEPEST, MOST_ELEMENTS = 16, 1 << 16  # structs and cells within one another; all of them


class Element(NamedTuple):
    """A part of a file."""

    kind: int
    start: int  # of the content
    end: int
    after: int  # the place of the next element


def elements(data: bytes, start: int, end: int, order: Order) -> Iterator[Element]:
    """The elements between two places, as far as they are whole."""
    while start + TAG <= end:
        kind, size = (int.from_bytes(data[k : k + 4], order) for k in (start, start + 4))
        if kind >> 16:  # the content lies in the tag
            yield Element(kind & 0xFFFF, start + 4, start + 4 + min(kind >> 16, 4), start + TAG)
            start += TAG
            continue
        start += TAG
        if size > end - start:
            return
        after = start + (size if kind == COMPRESSED else -(-size // TAG) * TAG)
        yield Element(kind, start, start + size, after)
        start = after


def check_elements(data: bytes, order: Order, path: Path) -> None:
    """Raises InputError for arrays nested too deeply or too many, and for one whose elements its class cannot have."""
    waiting, count = [(HEADER, len(data), 0)], 0
    while waiting:
        start, end, depth = waiting.pop()
        found = list(islice(elements(data, start, end, order), MOST_ELEMENTS + 1))
        arrays = [element for element in found if element.kind == MATRIX]
        count += len(arrays)
        if depth > DEEPEST or count > MOST_ELEMENTS or len(found) > MOST_ELEMENTS:
            raise InputError(
                f"{path}: structs and cells within one another; use at most {DEEPEST} levels and {MOST_ELEMENTS} arrays"
            )
        fault = _unfilled(found, start, end) or (_fault(data, found, order) if depth and found else "")
        if fault:
            raise InputError(f"{path}: damaged MAT-file: {fault}")
        waiting += [(array.start, array.end, depth + 1) for array in arrays]


def _unfilled(found: list[Element], start: int, end: int) -> str:
    """What is wrong with the lengths of elements between two places; empty if they fill it."""
    if (found[-1].after if found else start) != end:
        return "an element is longer than its place, or bytes are left over"
    odd = any(element.kind == MATRIX and (element.end - element.start) % TAG for element in found)
    return "an array of an odd length" if odd else ""


def _fault(data: bytes, found: list[Element], order: Order) -> str:
    """What is wrong with the elements of an array; empty if they are those of its class."""
    words = [
        [int.from_bytes(data[k : k + 4], order, signed=True) for k in range(element.start, element.end - 3, 4)]
        for element in found[:5]
    ]
    if len(words[0]) != 2:
        return "an array without its class"
    flags, kinds = words[0][0], [element.kind for element in found]
    kind = flags & 0xFF
    if kind == OPAQUE:
        return "" if kinds == [UNSIGNED, TEXT, TEXT, TEXT, MATRIX] else "an object of an unknown form"
    if kinds[:3] != [UNSIGNED, LENGTHS, TEXT] or not 2 <= len(words[1]) <= 32 or min(words[1]) < 0:
        return "an array without its lengths or its name"
    size, inside = math.prod(words[1]), kinds[3:]
    if kind in PLAIN:
        right = len(inside) == 1 and inside[0] in NUMBERS and not flags & COMPLEX
    elif kind == CELL:
        right = len(inside) == size and set(inside) <= {MATRIX}
    elif kind == STRUCT:
        longest = words[3][0] if len(inside) > 1 and words[3] else 0
        fields = (found[4].end - found[4].start) // longest if longest > 0 else 0
        right = longest > 0 and size <= MOST_ELEMENTS and inside[:2] == [LENGTHS, TEXT]
        right = right and len(inside) == 2 + size * fields and set(inside[2:]) <= {MATRIX}
    else:
        right = kind == FUNCTION and inside == [MATRIX]
    if right:
        return ""
    return "a sparse array: use full(...)" if kind == SPARSE else "an array with other elements than those of its class"
