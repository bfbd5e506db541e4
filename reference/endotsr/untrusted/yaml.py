"""YAML from a file: plain values, and matrices as OpenCV writes them."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import plain_line

LARGEST_FILE = 1 << 20  # bytes
MOST_VALUES = 1 << 20
DIRECTIVE = "%YAML"  # written by OpenCV with a colon, which is not YAML


def read_yaml(path: Path) -> Keys:
    """The mapping of a file. An OpenCV matrix becomes a mapping with rows, cols and data.

    Edges:   several documents that differ in `header` alone, as `rostopic echo` prints them, are one: the first.
    Raises:  InputError if the file cannot be read, is not a mapping, or has several documents that differ. Tags create
             only the values of the YAML standard, such as dates and sets, and no other objects.
    """
    import yaml

    text = read_text(path, LARGEST_FILE)
    if text.startswith(DIRECTIVE):
        text = text.partition("\n")[2]
    try:
        documents = [document for document in yaml.load_all(text, _loader()) if document is not None]
    # PyYAML passes on the errors of a value that its tag does not allow, such as `!!bool maybe`.
    except (yaml.YAMLError, RecursionError, ValueError, LookupError, AttributeError, TypeError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f" (line {mark.line + 1})" if mark is not None else ""
        said = getattr(error, "problem", None) or (str(error).splitlines() or ["too deep"])[0]
        raise InputError(f"{path}: not YAML: {plain_line(said)}{place}") from None
    bare = [{k: v for k, v in d.items() if k != "header"} if isinstance(d, dict) else d for d in documents]
    found = documents[0] if bare and bare.count(bare[0]) == len(bare) else None
    if len(documents) > 1 and found is None:
        raise InputError(f"{path}: {len(documents)} documents that differ; use a file with one")
    if not isinstance(found, dict):
        raise InputError(f"{path}: holds no keys; use YAML of the form `key: value`")
    return _with_names(found)


def _with_names(value: Any) -> Any:
    """The value, with the keys of every mapping as texts: YAML also has numbers, dates and nothing as keys."""
    if isinstance(value, dict):
        return {str(key): _with_names(entry) for key, entry in value.items()}
    return [_with_names(entry) for entry in value] if isinstance(value, list) else value


def _loader() -> Any:
    """A loader of plain values and OpenCV's matrices.

    An alias counts as all values that it repeats, and one in its own value as too many.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """Counts the values."""

        count = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            alias, before = self.check_event(yaml.AliasEvent), self.count
            node: Any = super().compose_node(parent, index)
            self.count += getattr(node, "values_inside", MOST_VALUES + 1) if alias else 1
            if not alias:
                node.values_inside = self.count - before
            if self.count > MOST_VALUES:
                raise yaml.YAMLError(f"more than {MOST_VALUES} values with those that aliases repeat")
            return node

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _matrix)
    return Loader


def _matrix(loader: Any, node: Any) -> dict[Any, Any]:
    return loader.construct_mapping(node, True)


def matrix(value: Any, where: str, *shapes: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers from a list, a list of rows, or a mapping with `data`, in one of these shapes (-1: any length).

    Raises:  InputError naming `where` and the shapes.
    """
    stored = value.get("data") if isinstance(value, dict) else value
    try:
        numbers = np.array(stored, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full(1, np.nan)
    for shape in shapes:
        if numbers.size == np.prod(shape) or (-1 in shape and numbers.size):
            if np.isfinite(numbers).all():
                return numbers.reshape(shape)
    allowed = " or ".join("x".join(str(n) if n > 0 else "n" for n in shape) for shape in shapes)
    raise InputError(f"{where}: use {allowed} finite numbers")
