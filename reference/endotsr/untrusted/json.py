"""JSON from a file: objects without NaN, checks of single values, and the types of structures."""

import json
import math
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.files import LARGEST_TEXT, MOST_PIXELS, read_text
from endotsr.untrusted.names import plain_line, shown

Keys = dict[str, Any]  # of a file, whose values are not checked yet
MOST_DIGITS = 60  # of an integer: the state of a random generator has 39
Count = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
Side = Annotated[int, msgspec.Meta(ge=1, le=MOST_PIXELS)]
Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]
Length = Annotated[float, msgspec.Meta(ge=-1e30, le=1e30)]
Positive = Annotated[float, msgspec.Meta(gt=0, le=1e30)]
Text = Annotated[str, msgspec.Meta(max_length=1 << 16, pattern="^[^\\x00]*$")]
Structure = TypeVar("Structure")


def read_json(path: Path, largest: int = LARGEST_TEXT) -> Keys:
    """The JSON object of a file. Raises InputError for an unreadable file and for any other content, including NaN."""
    data = parsed(read_text(path, largest), str(path))
    if not isinstance(data, dict):
        raise InputError(f"{path}: holds {type(data).__name__}; use an object with keys, as the run wrote it")
    return data


def parsed(text: str | bytes, where: str) -> Any:
    """JSON text as Python values. Raises InputError for anything else.

    Refused are invalid JSON, NaN, infinity, numbers beyond the largest float, integers of more than `MOST_DIGITS`
    characters, unpaired surrogates and excessive nesting.
    """
    try:
        found = json.loads(text, parse_constant=_refuse_constant, parse_float=_finite, parse_int=_integer)
        json.dumps(found, ensure_ascii=False).encode()  # refuses unpaired surrogates
        return found
    except RecursionError:
        raise InputError(f"{where}: cannot be read: it is nested too deeply") from None
    except ValueError as error:  # of JSON, of UTF-8, and of a number that is too long or too large
        raise InputError(f"{where}: cannot be read: {str(error).splitlines()[0]}") from None


def typed(data: Any, kind: type[Structure], where: object) -> Structure:
    """Plain data as a structure. Raises InputError naming the key of a value with the wrong type or range."""
    try:
        return msgspec.convert(data, kind, strict=True)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at `$")
        key = place.strip("`.") or "its content"
        raise InputError(f"{where}: {plain_line(key)}: {plain_line(reason[:1].lower() + reason[1:])}") from None


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"{digits[:20]} is beyond the largest number")
    return value


def _integer(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits; use at most {MOST_DIGITS}")
    return int(digits)


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"{name} is no JSON number")


def number(value: Any, where: str, low: float = -math.inf, high: float = math.inf) -> float:
    """A number in [low, high], at most 1.7e308 in size. Raises InputError for anything else, also True and False."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if low <= value <= high and abs(value) <= 1.7e308:  # refuses NaN, infinity and integers beyond any float
            return float(value)
    raise InputError(f"{where}: {shown(value)} is not allowed; use {_range('a finite number', low, high)}")


def integer(value: Any, where: str, low: float = -math.inf, high: float = math.inf) -> int:
    """An integer in [low, high]. Raises InputError for anything else, including True and False."""
    if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high:
        return value
    raise InputError(f"{where}: {shown(value)} is not allowed; use {_range('an integer', low, high)}")


def text(value: Any, where: str) -> str:
    """Text without a zero byte, which no path can contain. Raises InputError for anything else."""
    if isinstance(value, str) and "\0" not in value:
        return value
    raise InputError(f"{where}: {shown(value)} is not allowed; use text")


def listed(value: Any, where: str, count: int | None = None) -> list[Any]:
    """A list, of `count` entries if `count` is given. Raises InputError for anything else."""
    if isinstance(value, list) and count in (None, len(value)):
        return value
    found = f"{len(value)} entries" if isinstance(value, list) else type(value).__name__
    raise InputError(f"{where}: holds {found}; use a list{'' if count is None else f' of {count} entries'}")


def _range(what: str, low: float, high: float) -> str:
    limits = [f"{sign} {limit:g}" for sign, limit in ((">=", low), ("<=", high)) if math.isfinite(limit)]
    return " ".join([what, " and ".join(limits)]).strip()
