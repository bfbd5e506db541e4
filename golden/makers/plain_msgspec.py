"""What the judge uses of msgspec, in plain Python: the judge that runs with NumPy alone has it in the place of msgspec.

`make.py pack` stores this file as `msgspec/__init__.py` inside the archive of the judge. The installed package uses
msgspec itself. tests/port/delivery compares both on every case, and on files that must be refused.
"""

import copy
import json as standard
import math
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

PLAIN = {str: "str", bool: "bool", int: "int"}  # accepted as they are, no other type for them


class DecodeError(Exception):
    """The bytes are no JSON text."""


class ValidationError(DecodeError):
    """A value is not of the declared type."""


class Struct:
    """A record with typed fields; a class attribute is the default of a field, copied for every record."""

    _array_like = _strict = _frozen = False

    def __init_subclass__(
        cls,
        *,
        frozen: bool = False,
        kw_only: bool = False,
        array_like: bool = False,
        forbid_unknown_fields: bool = False,
    ) -> None:
        del kw_only  # every caller of the judge names the fields, or gives all in order
        cls._frozen, cls._array_like = cls._frozen or frozen, cls._array_like or array_like
        cls._strict = cls._strict or forbid_unknown_fields

    def __init__(self, *values: Any, **named: Any) -> None:
        names = _fields(type(self))
        named |= dict(zip(names, values))
        if set(named) - set(names):
            raise TypeError(f"{type(self).__name__}: no field {min(set(named) - set(names))}")
        for name in names:
            if name not in named and not hasattr(type(self), name):
                raise TypeError(f"{type(self).__name__}: missing field {name}")
            value = named[name] if name in named else copy.copy(getattr(type(self), name))
            object.__setattr__(self, name, value)
        if hasattr(self, "__post_init__"):
            self.__post_init__()  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any) -> None:
        if self._frozen:
            raise AttributeError(f"{type(self).__name__}: immutable")
        object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((type(self), *vars(self).values()))


_known: dict[type, dict[str, Any]] = {}


def _fields(kind: type) -> dict[str, Any]:
    """Type of every field by name, in the order of declaration, those of the base classes first."""
    if kind not in _known:
        _known[kind] = get_type_hints(kind)
    return _known[kind]


def convert(value: Any, kind: Any, where: str = "$") -> Any:
    """A value of JSON as a value of the declared type. Raises: ValidationError that names the place."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin is Literal:
        if any(type(value) is type(one) and value == one for one in inner):
            return value
    elif origin in (Union, UnionType):
        return None if value is None and NoneType in inner else convert(value, inner[0], where)
    elif origin in (list, tuple) and isinstance(value, list):
        return _sequence(value, origin, inner, where)
    elif origin is dict and isinstance(value, dict):
        return {key: convert(one, inner[1], f"{where}.{key}") for key, one in value.items()}
    elif isinstance(kind, type) and issubclass(kind, Struct):
        return _record(value, kind, where)
    elif kind is float and type(value) in (int, float):
        return float(value)
    elif kind in PLAIN and type(value) is kind:
        return value
    raise ValidationError(f"expected {getattr(kind, '__name__', kind)}, got {type(value).__name__} - at `{where}`")


def _sequence(value: list, origin: Any, inner: tuple[Any, ...], where: str) -> Any:
    many = origin is list or inner[-1] is Ellipsis
    kinds = [inner[0]] * len(value) if many else list(inner)
    if len(kinds) != len(value):
        raise ValidationError(f"expected {len(kinds)} entries, got {len(value)} - at `{where}`")
    return origin(convert(one, kind, f"{where}[{k}]") for k, (one, kind) in enumerate(zip(value, kinds)))


def _record(value: Any, kind: Any, where: str) -> Any:
    fields = _fields(kind)
    if kind._array_like and isinstance(value, list) and len(value) == len(fields):
        value = dict(zip(fields, value))
    elif kind._array_like or not isinstance(value, dict):
        raise ValidationError(f"expected {kind.__name__}, got {type(value).__name__} - at `{where}`")
    extra, missing = set(value) - set(fields), [n for n in fields if n not in value and not hasattr(kind, n)]
    if missing or (extra and kind._strict):
        text = f"missing field `{missing[0]}`" if missing else f"unknown field `{min(extra)}`"
        raise ValidationError(f"{text} - at `{where}`")
    return kind(**{name: convert(value[name], fields[name], f"{where}.{name}") for name in fields if name in value})


def _builtins(value: Any) -> Any:
    """Records as objects or lists; numbers that are not finite as null."""
    if isinstance(value, Struct):
        parts = {name: _builtins(one) for name, one in vars(value).items()}
        return list(parts.values()) if value._array_like else parts
    if isinstance(value, dict):
        return {key: _builtins(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_builtins(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _constant(text: str) -> Any:
    raise ValidationError(f"JSON has no number {text}")


def _decode(data: bytes | str, type: Any = Any) -> Any:
    try:
        value = standard.loads(data, parse_constant=_constant)
    except standard.JSONDecodeError as error:
        raise DecodeError(str(error)) from None
    return convert(value, type)


def _encode(value: Any) -> bytes:
    return standard.dumps(_builtins(value), ensure_ascii=False, separators=(",", ":")).encode()


def _indented(data: bytes, indent: int = 2) -> bytes:
    return standard.dumps(standard.loads(data), ensure_ascii=False, indent=indent).encode()


def _replace(record: Any, **changes: Any) -> Any:
    return type(record)(**(vars(record) | changes))


json = SimpleNamespace(decode=_decode, encode=_encode, format=_indented)
structs = SimpleNamespace(replace=_replace)
