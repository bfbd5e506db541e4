"""The options of a command, derived from a typed class.

In: a dataclass whose fields are options or sections of settings (msgspec structures). Out: one `Field` per option and
positional argument, with name, type, default and help. The help of a field is the docstring below it, read from the
source of its module by `ast`. parser.py reads command lines.
"""

import ast
import dataclasses
import inspect
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from endotsr.untrusted.sections import is_section

REQUIRED: Any = dataclasses.MISSING  # the default of a required option
METAVARS = {int: "INT", float: "FLOAT", str: "TEXT"}


@dataclass(frozen=True)
class Option:
    """Command-line attributes of a field: `Annotated[Path, Option("RUN", positional=True)]`."""

    metavar: str = ""  # the value in the help; empty = derived from the type
    positional: bool = False  # an argument without a name
    may_be_empty: bool = False  # of several values: none is allowed
    written: bool = False  # an output file, checked before the computation
    otherwise: str = ""  # the end of the message on a value that is not allowed: the option that may be meant
    flat: bool = False  # a section of settings whose options omit the name of the field
    short: tuple[str, ...] = ()  # keys of a section that also exist without its name: `--scale`


@dataclass(frozen=True)
class Field:
    """One option or positional argument of a command."""

    path: tuple[str, ...]  # attributes from the options class to the value
    name: str  # `--model.frequency-max`; the metavar of a positional argument
    kind: Any  # type of the value, with the limits of a number
    default: Any  # REQUIRED without a default
    help: str
    section: type | None  # the section of settings; None outside a section
    metavar: str
    positional: bool
    may_be_empty: bool = False
    written: bool = False
    otherwise: str = ""

    @property
    def in_section(self) -> bool:
        """Whether it is a setting named with its section: `--model.bases`."""
        return not self.positional and "." in self.name

    @property
    def switch(self) -> bool:
        """Whether the option is boolean and has no value."""
        return self.kind is bool

    @property
    def off(self) -> str:
        """The negated switch: `--model.no-appearance`."""
        section, dot, key = self.name.removeprefix("--").rpartition(".")
        return f"--{section}{dot}no-{key}"

    @property
    def key(self) -> str:
        """The key in a settings file: `model.frequency_max`."""
        return self.name.removeprefix("--").replace("-", "_")

    @property
    def count(self) -> int | str:
        """The number of values: 1, a fixed number n, or "*"."""
        if get_origin(self.kind) is not tuple:
            return 1
        return "*" if get_args(self.kind)[-1] is Ellipsis else len(get_args(self.kind))

    @property
    def item(self) -> Any:
        """The type of one value."""
        return self.kind if self.count == 1 else get_args(self.kind)[0]


def fields_of(options: type, default: Any = None) -> list[Field]:
    """Every option and positional argument of a class, with defaults from the instance `default`, if given."""
    return list(_walk(options, default, (), "", None))


def _walk(kind: type, values: Any, path: tuple[str, ...], prefix: str, section: type | None) -> Iterator[Field]:
    texts = _attribute_docstrings(kind)
    for name, annotated, fallback in _declared(kind):
        note, plain = _split_note(annotated)
        value = fallback if values is None else getattr(values, name)
        if is_section(plain):
            inside = list(_walk(plain, value, (*path, name), prefix if note.flat else f"{prefix}{name}.", plain))
            for field in (field for field in inside if field.key in note.short):
                short, about = f"--{field.key.rpartition('.')[2]}", f"{field.help} (= {field.name})"
                yield dataclasses.replace(field, name=short, help=about, section=None)
            yield from inside
        else:
            yield Field(
                path=(*path, name),
                name=note.metavar if note.positional else f"--{prefix}{name}".replace("_", "-"),
                kind=plain,
                default=value,
                help=texts.get(name, ""),
                section=section,
                metavar=note.metavar or _metavar(plain),
                positional=note.positional,
                may_be_empty=note.may_be_empty,
                written=note.written,
                otherwise=note.otherwise,
            )


def _declared(kind: type) -> list[tuple[str, Any, Any]]:
    """Name, annotated type and default of every field, in declaration order."""
    if is_section(kind):
        return [(f.name, f.type, f.default) for f in msgspec.structs.fields(kind)]
    hints = get_type_hints(kind, include_extras=True)
    return [(f.name, hints[f.name], f.default) for f in dataclasses.fields(kind)]


def _split_note(annotated: Any) -> tuple[Option, Any]:
    """The `Option` of an annotated type (default: `Option()`), and the type without it."""
    if get_origin(annotated) is not Annotated:
        return Option(), annotated
    plain, *notes = get_args(annotated)
    option = next((note for note in notes if isinstance(note, Option)), Option())
    others = [note for note in notes if not isinstance(note, Option)]
    return option, Annotated[(plain, *others)] if others else plain


def _metavar(kind: Any) -> str:
    """The metavar of a type: `FLOAT`, `{quartic,gaussian}`, `{FLOAT,auto}`, `INT ...`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _metavar(arguments[0])
    if origin is Literal:
        return "{" + ",".join(map(str, arguments)) + "}"
    if origin in (Union, UnionType):
        parts = [_metavar(part).strip("{}") for part in arguments if part is not NoneType]
        choices = len(parts) > 1 or any(get_origin(part) is Literal for part in arguments)
        return "{" + ",".join(parts) + "}" if choices else parts[0]
    if origin is tuple:
        return f"{_metavar(arguments[0])} ..." if arguments[-1] is Ellipsis else " ".join(map(_metavar, arguments))
    return METAVARS.get(kind, "PATH")


def _attribute_docstrings(kind: type) -> dict[str, str]:
    """Name of a field -> the docstring below it, including base classes."""
    texts: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if base.__module__.startswith("endotsr."):
            texts |= _docstrings_of_module(base.__module__).get(base.__name__, {})
    return texts


@cache
def _docstrings_of_module(name: str) -> dict[str, dict[str, str]]:
    """Class -> field -> docstring, for all classes of a module."""
    tree = ast.parse(inspect.getsource(sys.modules[name]))
    return {
        node.name: {
            field.target.id: " ".join(below.value.value.split())
            for field, below in pairwise(node.body)
            if isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        }
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
