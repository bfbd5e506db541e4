"""Parse a command line into the typed options of a command.

argparse splits the words into options, values and positional arguments. Values are converted by the types of the
options class; sections of settings are checked by msgspec. A mistake raises a one-line InputError with the option and
the allowed values, never a message of argparse.

Two libraries were tried in its place on `train`, `prepare` and `sweep`. tyro 1.0.17 ignores the limits of
`msgspec.Meta`, so that a value out of range passes; cyclopts 5.5.2 does not read msgspec structures. Neither has the
relations between options.
"""

import argparse
import math
import re
from decimal import Decimal
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec

from endotsr.cli.parts.fields import REQUIRED, Field, fields_of
from endotsr.cli.parts.help_page import help_page, short_fields, terminal_width
from endotsr.cli.parts.mistakes import refuse_other_dashes, unknown_word
from endotsr.cli.parts.related_options import FACTS, RELATIONS
from endotsr.cli.parts.relations import check_relations
from endotsr.config import merged
from endotsr.errors import InputError
from endotsr.training.runs.files import refuse_texts
from endotsr.untrusted.json import Keys
from endotsr.untrusted.sections import allowed_values, checked

T = TypeVar("T")
HELP_ALL = "--help-all"
HELP = {"-h", "--help", HELP_ALL}
THOUSANDS = {"k": 1e3, "K": 1e3, "M": 1e6}
FROM_END = re.compile(r"-\d*:[-\d:,.s]*|-\d+s?,[-\d:,.s]+")  # frames counted from the end: -5: or -5:-1
NEGATIVE = re.compile(r"-\d+|-\d*\.\d+")  # numbers of argparse before Python 3.14
WINDOW = "X Y WIDTH HEIGHT"
GEOMETRY = re.compile(r"(\d+)x(\d+)\+(\d+)\+(\d+)!?")  # of ImageMagick and X11
FILTER = re.compile(r"crop=(\d+):(\d+):(\d+):(\d+)")  # of FFmpeg: width, height, x, y
SWITCH_WORDS = {"true": True, "false": False}  # after a switch, as in a settings file


def parse(options: type[T], words: list[str], command: str, default: T | None = None) -> T:
    """The options of a command, with defaults from `default`, if given.

    `--help` prints the short help, `--help-all` all options; both raise SystemExit(0).

    Raises:  InputError for an unknown option, a value of the wrong type or range, a missing option, options that
             exclude one another or lack their partner, and a file that cannot be written.
    """
    fields = fields_of(options, default)
    if HELP & set(words):
        shown = fields if HELP_ALL in words else short_fields(fields)
        print(help_page(options, shown, command, terminal_width(), len(fields) - len(shown)), end="")
        raise SystemExit(0)
    refuse_other_dashes(fields, words)
    given, unknown = _given(fields, words)
    if unknown:
        raise unknown_word(fields, unknown, command, has_result=("out",) in given)
    missing = [f for f in fields if f.default is REQUIRED and f.path not in given]
    if missing:
        names = ", ".join(f.name if f.positional else f"{f.name} {f.metavar}" for f in missing)
        raise InputError(f"{command}: missing: {names}; `endotsr {command} --help` lists the options")
    found = _built(options, fields, given, default)
    if command not in FACTS:
        check_relations(command, RELATIONS.get(command, ()), found, _names(fields, given))
    refuse_texts({field.name: getattr(found, field.path[0]) for field in fields if field.written})
    return found


def parse_known(options: type[T], words: list[str]) -> T:
    """These options only, from words that may have others too. Raises InputError for an invalid value."""
    fields = fields_of(options)
    return _built(options, fields, _given(fields, words)[0], None)


def given_names(options: type, words: list[str]) -> frozenset[str]:
    """Names of the given options without dashes, as in the terms of `relations`: `model.bases`, `source-rate`."""
    fields = fields_of(options)
    return _names(fields, _given(fields, words)[0])


def _names(fields: list[Field], given: dict[tuple[str, ...], Any]) -> frozenset[str]:
    named = {field.path: field.name.removeprefix("--") for field in fields}
    return frozenset(named[path] for path in given)


def given_keys(options: type, words: list[str]) -> frozenset[str]:
    """Keys of the given options: `model.bases` for `--model.bases 9`, `sequence.scale` for `--scale 1`."""
    fields = fields_of(options)
    named = {field.path: field.key for field in fields}
    return frozenset(named[path] for path in _given(fields, words)[0])


def _given(fields: list[Field], words: list[str]) -> tuple[dict[tuple[str, ...], Any], list[str]]:
    """Path -> converted value of every given option, and the words that belong to none."""
    by_path = {".".join(field.path): field for field in fields}
    parser = _parser(fields)
    try:
        found, unknown = parser.parse_known_intermixed_args(_plain_words(fields, words))
    except argparse.ArgumentError as error:  # the only remaining error: too few values
        field = next(f for f in fields if f.name == error.argument_name)
        raise InputError(f"{field.name}: missing value {field.metavar}") from None
    given = {field.path: _value(field, vars(found)[path]) for path, field in by_path.items() if path in vars(found)}
    return given, unknown


def _parser(fields: list[Field]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        add_help=False, allow_abbrev=False, exit_on_error=False, argument_default=argparse.SUPPRESS
    )
    for field in fields:
        path = ".".join(field.path)
        if field.positional:
            parser.add_argument(path, nargs="?" if field.count == 1 else "*")
        elif field.switch:
            parser.add_argument(field.name, dest=path, action="store_true")
            parser.add_argument(field.off, dest=path, action="store_false")
        else:
            several = field.count != "*" or field.may_be_empty  # otherwise an option without values is a mistake
            count = field.count if several else "+"
            more = "extend" if field.count == "*" else "store"  # `--sizes 1 --sizes 2` is `--sizes 1 2`
            parser.add_argument(field.name, dest=path, action=more, nargs=None if count == 1 else count)
    return parser


def _plain_words(fields: list[Field], words: list[str]) -> list[str]:
    """The words in the form of argparse: names with `-` for `_`, and every switch as `--name` or `--no-name`.

    `--model.appearance false`, the form of a settings file, becomes `--model.no-appearance`. `--x -1e-3` becomes
    `--x=-1e-3`, because argparse would read the number as an option; one of several values becomes -0.001. Raises
    InputError for `--switch=other`.
    """
    by_name = {field.name: field for field in fields if not field.positional}
    negated = {field.off: field for field in by_name.values() if field.switch}
    out: list[str] = []
    several = False  # whether the word may be one of several values
    for word in words:
        name, equals, value = word.partition("=")
        if name.startswith("--"):
            name = name.replace("_", "-")
            several = name in by_name and by_name[name].count != 1
        before = by_name.get(out[-1]) if out else None
        if equals and name in by_name and by_name[name].switch:
            out.append(_switched(by_name[name], value))
        elif equals and name in negated:
            out.append(_switched(negated[name], value, on=False))
        elif before and before.switch and word.lower() in SWITCH_WORDS:
            out[-1] = _switched(before, word)
        elif before and not before.switch and before.count == 1 and (_is_negative(word) or FROM_END.fullmatch(word)):
            out[-1] += f"={word}"
        else:
            out.append(_without_exponent(word) if several and _is_negative(word) else name + equals + value)
    return out


def _switched(switch: Field, value: str, on: bool = True) -> str:
    if value.lower() not in SWITCH_WORDS:
        raise _refused(switch, value)
    return switch.name if SWITCH_WORDS[value.lower()] == on else switch.off


def _without_exponent(word: str) -> str:
    """A negative number in the form that argparse takes for a number; other words, such as -inf, unchanged."""
    number = float(word)
    plain = NEGATIVE.fullmatch(word) or not math.isfinite(number)
    return word if plain else f"{Decimal(repr(number)):f}"


def _is_negative(word: str) -> bool:
    try:
        return word.startswith("-") and isinstance(float(word), float)
    except ValueError:
        return False


def _value(field: Field, found: Any) -> Any:
    """The value from argparse (words, or a boolean for a switch), converted to the type of the option."""
    if field.switch:
        return found
    words = [found] if field.count == 1 else found
    values = []
    for word in words:
        try:
            values.append(converted(field.item, word))
        except ValueError:
            raise _refused(field, word) from None
    return values[0] if field.count == 1 else tuple(values)


def converted(kind: Any, word: str) -> Any:
    """A word converted to a type; limits are not checked. Raises ValueError if that is impossible."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return converted(arguments[0], word)
    if origin is Literal:
        if word not in map(str, arguments):
            raise ValueError(word)
        return next(choice for choice in arguments if str(choice) == word)
    if origin in (Union, UnionType):
        for part in arguments:
            try:
                return converted(part, word)
            except ValueError:
                continue
        raise ValueError(word)
    if kind is NoneType or (kind is Path and not word.strip()):  # Path("") is the working folder
        raise ValueError(word)
    return kind(word)


def _refused(field: Field, word: str) -> InputError:
    allowed = allowed_values(field.item) + _written_out(field, word)
    if field.in_section:
        return InputError(f"command line: {field.key} = {word!r} is not allowed; use {allowed}")
    return InputError(f"{field.name} {word!r} is not allowed; use {allowed}{field.otherwise}")


def _written_out(field: Field, word: str) -> str:
    """Advice for numbers as people write them: 1k, 29,97, 4mm, several with commas, or WxH+X+Y; "" for other words."""
    if field.metavar == WINDOW and (found := GEOMETRY.fullmatch(word) or FILTER.fullmatch(word)):
        width, height, x, y = found.groups()
        return f", as {WINDOW}: {field.name} {x} {y} {width} {height}"
    if field.count != 1 and re.fullmatch(r"[-\d., ;]+[,;][-\d., ;]+", word):
        return f", apart from the others: {field.name} {' '.join(re.split('[,; ]+', word.strip(',; ')))}"
    if found := re.fullmatch(r"(\d+\.?\d*|\.\d+)([kKM])", word):
        number, advice = f"{float(found[1]) * THOUSANDS[found[2]]:.15g}", "written out"
    elif re.fullmatch(r"-?\d*,\d+", word):
        number, advice = word.replace(",", "."), "with a decimal point"
    elif found := re.fullmatch(r"(-?\d+\.?\d*|-?\.\d+)\s*[^\d\s.,]\D*", word):
        number, advice = found[1], "without a unit"
    else:
        return f", as {WINDOW}" if field.metavar == WINDOW else ""
    try:
        converted(field.item, number)
    except ValueError:
        return ""
    return f", {advice} ({number})"


def _built(options: type[T], fields: list[Field], given: dict[tuple[str, ...], Any], default: T | None) -> T:
    """The options with the given values; changed sections are checked."""
    values: Keys = {} if default is None else dict(vars(default))
    sections: dict[str, Keys] = {}
    for path, value in given.items():
        if len(path) == 1:
            values[path[0]] = value
        else:
            _put(sections.setdefault(path[0], {}), path[1:], value)
    for name, changes in sections.items():
        start = values.get(name, getattr(options, name))
        flat = any(field.path[0] == name and not field.key.startswith(f"{name}.") for field in fields)
        data = merged(msgspec.to_builtins(start), changes)
        values[name] = checked(data, type(start), "command line", "" if flat else f"{name}.")
    return options(**values)


def _put(tree: Keys, path: tuple[str, ...], value: Any) -> None:
    for name in path[:-1]:
        tree = tree.setdefault(name, {})
    tree[path[-1]] = value
