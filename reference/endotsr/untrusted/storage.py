"""OpenCV's storage in XML: plain values and matrices, without entities."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from endotsr.errors import InputError
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import plain_line

LARGEST_FILE = 1 << 20  # bytes
DEEPEST = 100  # keys within one another


def read_storage(path: Path) -> Keys:
    """The keys below `opencv_storage`: numbers, texts, and matrices as a mapping with rows, cols and data.

    Edges:   of several keys of one name, the last one counts.
    Raises:  InputError for a file that is not XML, has a document type or a CDATA section, has another root, or nests
             its keys more than `DEEPEST` deep.
    """
    text = read_text(path, LARGEST_FILE)
    if "<!" in text.replace("<!--", ""):
        raise InputError(f"{path}: declares a document type; use a file as OpenCV writes it")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not XML: {plain_line(str(error))}") from None
    if root.tag != "opencv_storage":
        raise InputError(f"{path}: the root is {plain_line(root.tag)[:60]}; use a file with opencv_storage")
    try:
        return {child.tag: _value(child, 1) for child in root}
    except RecursionError:
        raise InputError(f"{path}: cannot be read: keys are nested more than {DEEPEST} deep") from None


def _value(node: ElementTree.Element, depth: int) -> Any:
    """A mapping for nested keys, a number, or the text. Raises RecursionError beyond `DEEPEST`."""
    if depth > DEEPEST:
        raise RecursionError
    if len(node):
        inner = {child.tag: _value(child, depth + 1) for child in node}
        data = node.findtext("data")
        return inner if data is None else inner | {"data": [_number(word) for word in data.split()]}
    words = (node.text or "").split()
    return _number(words[0]) if len(words) == 1 else " ".join(words)


def _number(word: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
