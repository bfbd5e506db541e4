"""The format of the files of `golden/` as typed structures, through which all JSON is read and written.

Names and paths of files are checked as soon as a structure is made: none leaves the folder it belongs to.
"""

import inspect
import json
from pathlib import Path
from typing import Any, Literal

import msgspec

from endotsr.untrusted.files import LARGEST_TEXT, read_bytes
from endotsr.untrusted.names import file_name, plain_line, relative_path

Level = Literal[0, 1, 2, 3, 4, 5]
LEVELS = {
    0: "reading",
    1: "operations, forward",
    2: "operations, reverse",
    3: "render and full loss with every gradient",
    4: "a training trajectory",
    5: "determinism",
}
Precision = Literal["float32", "float64"]
MOST_RUNS = 1000  # of a port with races
BITS = 5  # the level that asks for equal bits in two runs
OPTIONS = ("exposure",)  # operations that a case of another operation may use; its arrays are named after them
FLIP_BUDGET = "band"  # the name in the files of the rule that lets some entries flip


class _Strict(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Common strictness."""


class Rule(_Strict, frozen=True, kw_only=True):
    """How an output is compared.

    exact      every entry equal
    relative   |got - expected| <= tolerance x scale, every entry
    band       relative, but up to `flips` entries may be off by up to `flip_size` x scale
    identical  relative, and bitwise equal to the output named in `to`
    either-of  relative, to `file` or to one of `others`; the same one for all outputs of the case
    """

    kind: Literal["exact", "relative", "band", "identical", "either-of"]
    scale: Literal["", "max", "last"] = ""
    """max: largest magnitude of the array; last: of each column [..., n], at least 1/1000 of max (one axis: max)"""
    float64: float = 0.0
    float32: float = 0.0
    flips: int = 0
    flip_size: float = 0.0
    to: str = ""
    others: tuple[str, ...] = ()
    """either-of: files of the other legal answers, in the same order for every output of the case"""


class Because(_Strict, frozen=True, kw_only=True):
    """What the tolerances were derived from, in units of the scale."""

    spread_float64: float
    """change under relative input changes of 2^-52 and under another order of evaluation"""
    spread_float32: float
    """reference in float32 against float64, and change under relative input changes of 2^-23"""
    smallest_mutant: float | None = None
    """smallest change by a mistake that this output has to catch; null: it is there for completeness"""


class Truth(_Strict, frozen=True, kw_only=True):
    """Where the expected value comes from."""

    kind: Literal["oracle", "self"]
    oracle: str = ""
    """name of the independent program that gives the same value; tests/port/vectors/test_truth.py says which it is"""


class Array(_Strict, frozen=True, kw_only=True):
    """An input."""

    file: str
    unit: str
    dtype: Literal["real", "integer", "boolean"]
    shape: tuple[int, ...]
    recipe: str

    def __post_init__(self) -> None:
        relative_path(self.file, "file")


class Output(_Strict, frozen=True, kw_only=True):
    """An expected output."""

    file: str
    level: Level
    unit: str
    dtype: Literal["real", "integer", "boolean"]
    shape: tuple[int, ...]
    compare: Rule
    because: Because | None
    truth: Truth
    order: Literal["", "iteration"] = ""
    """iteration: entry k is of iteration k + 1, so that the first wrong entry is the one to look at"""

    def __post_init__(self) -> None:
        for file in (self.file, *self.compare.others):
            relative_path(file, "file")

    def answer(self, number: int) -> str:
        """File of a legal answer of the case; 0 = `file`, which is also that of outputs with one answer only."""
        return self.compare.others[number - 1] if number and self.compare.others else self.file


class Shown(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """What a known mistake does to one output; in the files, a list of two."""

    distance: float | None
    """in units of the scale; null: the wrong output is not finite or has another shape"""
    fingerprint: float | None
    """sum of +-entries of the wrong output, of its entries that are not finite (each as 1) if there are any; null: it
    has another shape, or another mistake gives the same integers or booleans"""


class Mistake(_Strict, frozen=True, kw_only=True):
    """What a known mistake does to the outputs of a case."""

    shows: dict[str, Shown]
    """every output that it changes; empty: the mistake was examined on this case and leaves it right"""
    rounding: bool = False
    """it loses digits only: the size of the change identifies it, and `shows` is that of a port in float64"""
    shows_float32: dict[str, Shown] = {}
    """of a rounding mistake, in a port in float32"""

    def shown(self, precision: str) -> dict[str, Shown]:
        """What it does in a port of this precision."""
        return self.shows_float32 if self.rounding and precision == "float32" else self.shows


class Case(_Strict, frozen=True, kw_only=True):
    """case.json"""

    format: Literal[2] = 2
    family: str
    case: str
    operation: str
    equation: str
    pairs: tuple[str, ...]
    title: str
    level: Level
    flags: tuple[str, ...]
    settings: dict[str, Any]
    inputs: dict[str, Array]
    outputs: dict[str, Output]
    mistakes: dict[str, Mistake]
    """every mistake that was examined on this case"""

    def __post_init__(self) -> None:
        for name in (self.family, self.case, *self.outputs):
            file_name(name, "a name of the case")

    @property
    def name(self) -> str:
        """family/case"""
        return f"{self.family}/{self.case}"

    @property
    def options(self) -> tuple[str, ...]:
        """Options that the case uses, by the operations of their equations: without them a port leaves it out."""
        names = (*self.inputs, *self.outputs)
        return tuple(option for option in OPTIONS if any(f"{option}_" in name for name in names))

    @property
    def parts(self) -> set[str]:
        """Its operation and those of its options."""
        return {self.operation, *self.options}

    @property
    def answers(self) -> int:
        """Number of legal answers to the whole case."""
        return 1 + max(len(output.compare.others) for output in self.outputs.values())


class FileEntry(_Strict, frozen=True, kw_only=True):
    """A file of the cases folder; offset, shape and dtype for .npy only."""

    path: str
    sha256: str
    bytes: int
    offset: int | None = None
    dtype: str | None = None
    shape: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        relative_path(self.path, "path")


class FlagNote(_Strict, frozen=True, kw_only=True):
    """A mistake that has a name."""

    title: str
    wrong: str


class Manifest(_Strict, frozen=True, kw_only=True):
    """manifest.json"""

    version: str
    machine: str
    """class of the machine that wrote the values; on it they are reproduced bit by bit"""
    families: dict[str, tuple[str, ...]]
    flags: dict[str, FlagNote]
    files: tuple[FileEntry, ...]

    def __post_init__(self) -> None:
        for family, cases in self.families.items():
            for name in (family, *cases):
                file_name(name, "families")


class RequestInput(_Strict, frozen=True, kw_only=True):
    """What an input is."""

    unit: str
    """"display / 255": the numbers run to 255, and a colour in display units is the number / 255"""
    axes: str
    """names of the axes, from the outside in"""


class RequestOutput(_Strict, frozen=True, kw_only=True):
    """What is asked for."""

    level: Level
    unit: str
    axes: str
    dtype: Literal["real", "integer", "boolean"]
    shape: tuple[int, ...]


class Request(_Strict, frozen=True, kw_only=True):
    """request.json: a case without its answers."""

    family: str
    case: str
    operation: str
    equation: str
    page: str
    """of the equation, in the repository"""
    settings: dict[str, Any]
    inputs: dict[str, str]
    about: dict[str, RequestInput]
    """what each input is"""
    outputs: dict[str, RequestOutput]

    def __post_init__(self) -> None:
        for file in self.inputs.values():
            relative_path(file, "inputs")
        for name in self.outputs:
            file_name(name, "outputs")


class Requests(_Strict, frozen=True, kw_only=True):
    """requests.json at the root of a request folder."""

    version: str
    precision: Precision
    level: Level
    cases: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.cases:
            relative_path(name, "cases")


def to_json(value: msgspec.Struct) -> str:
    """Indented JSON text with a final newline; the same bytes for the same value."""
    return msgspec.json.format(msgspec.json.encode(value), indent=1).decode() + "\n"


def schema_text(kind: type[msgspec.Struct]) -> str:
    """JSON Schema of one of the structures; the same bytes with every Python and msgspec.

    Python 3.13 and msgspec 0.23 remove the indentation of a docstring, and earlier versions keep it.
    """
    schema = msgspec.json.schema(kind)
    for part in schema["$defs"].values():
        if "description" in part:
            first, *more = inspect.cleandoc(part["description"]).split("\n")
            part["description"] = "\n".join([first, *("    " + line if line else "" for line in more)])
    return json.dumps(schema, indent=1) + "\n"


def read_struct(path: Path, kind: type[Any]) -> Any:
    """Raises InputError if the file cannot be read, msgspec.DecodeError / ValidationError if it is not of this kind."""
    data = read_bytes(path, LARGEST_TEXT)
    try:
        return msgspec.json.decode(data, type=kind)
    except (RecursionError, UnicodeDecodeError) as error:
        raise msgspec.DecodeError(f"no JSON text: {error}") from None
    except msgspec.DecodeError as error:  # it repeats the name of an unknown field
        raise type(error)(plain_line(str(error))) from None
