"""Sections of settings: typed, frozen tables of keys, checked against their types and ranges.

In: plain data of a TOML or JSON file, or of a command line. Out: a section, or an `InputError` with the key and the
allowed values.
"""

import difflib
import math
import re
from collections.abc import Iterable
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import choice

SectionType = TypeVar("SectionType", bound=msgspec.Struct)
Positive = Annotated[float, msgspec.Meta(gt=0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=0)]
PositiveCount = Annotated[int, msgspec.Meta(ge=1)]


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A section of settings, also of the simulator: frozen, fields by name only, unknown keys rejected."""

    def refuse_contradictions(self, where: str) -> None:
        """Raise InputError for values that are allowed individually but not in combination; here there are none."""


def checked(data: Keys, kind: type[SectionType], where: str, prefix: str = "") -> SectionType:
    """A section from plain data, with types and ranges checked. Raises InputError with key and allowed values."""
    _refuse_non_finite(data, where, prefix)
    try:
        found = msgspec.convert(data, kind, strict=True)
    except msgspec.ValidationError as error:
        raise InputError(f"{where}: {_explain(str(error), data, kind, prefix)}") from None
    if isinstance(found, Section):
        found.refuse_contradictions(where)
    return found


def refuse_unknown_keys(data: dict, struct: type, where: str, prefix: str = "") -> None:
    """Raise InputError for a key that `struct` does not have."""
    fields = {f.name: f.type for f in msgspec.structs.fields(struct)}
    for key, value in data.items():
        if key not in fields:
            raise InputError(f"{where}: {unknown_key(key, fields, prefix)}")
        if isinstance(value, dict) and is_section(fields[key]):
            refuse_unknown_keys(value, fields[key], where, f"{prefix}{key}.")


def unknown_key(key: str, allowed: Iterable[str], prefix: str = "") -> str:
    """What is wrong with an unknown key: the allowed ones, and at the end the one that is spelled most like it."""
    listed = list(allowed)
    meant = "".join(f"; did you mean {name}?" for name in difflib.get_close_matches(key, listed, n=1))
    return f"unknown key {prefix}{key}; use {choice(listed)}{meant}"


def is_section(kind: Any) -> bool:
    """Whether a type is a section of settings."""
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _refuse_non_finite(data: dict, where: str, prefix: str) -> None:
    for key, value in data.items():
        if isinstance(value, dict):
            _refuse_non_finite(value, where, f"{prefix}{key}.")
        for number in value if isinstance(value, list | tuple) else [value]:
            if isinstance(number, float) and not math.isfinite(number):
                raise InputError(f"{where}: {prefix}{key} = {value!r} is not allowed; use finite numbers")


def _explain(message: str, data: dict, kind: Any, prefix: str) -> str:
    """Key, value and allowed values, from the message `... - at `$.section.key`` of the type check."""
    found = re.search(r"`\$\.([\w.]+)", message)
    place = f"{found[1]}." if found else ""
    if missing := re.search(r"missing required field `(\w+)`", message):
        return f"{prefix}{place}{missing[1]} is missing"
    if not found:
        return message
    value: Any = data
    for name in found[1].split("."):
        kind = next(filter(is_section, get_args(kind)), kind)  # an optional section
        kind = {f.name: f.type for f in msgspec.structs.fields(kind)}[name]
        value = value[name]
    return f"{prefix}{found[1]} = {value!r} is not allowed; use {allowed_values(kind)}"


def allowed_values(kind: Any) -> str:
    """The allowed values of a type in words: `a number > 0`, `quartic or gaussian`, `one of a, b, c`, ..."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Literal:
        return choice(map(str, arguments))
    if origin in (Union, UnionType):
        return " or ".join(allowed_values(part) for part in arguments if part is not NoneType)
    if origin in (tuple, list):
        many = "a list" if origin is list or arguments[-1] is Ellipsis else f"{len(arguments)} values"
        return f"{many}, each {allowed_values(arguments[0])}"
    if origin is Annotated:
        limits = [(">", arguments[1].gt), (">=", arguments[1].ge), ("<", arguments[1].lt), ("<=", arguments[1].le)]
        words = " and ".join(f"{sign} {limit:g}" for sign, limit in limits if limit is not None)
        least = f", at least {arguments[1].min_length} of them" if arguments[1].min_length else ""
        return f"{allowed_values(arguments[0])} {words}".rstrip() + least
    if origin is dict:
        return "a table of keys"
    if is_section(kind):
        return "a section of settings"
    return {bool: "true or false", int: "an integer", float: "a number", str: "text", Path: "a path"}[kind]
