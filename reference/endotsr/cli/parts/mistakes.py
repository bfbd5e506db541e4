"""What is said about an option that cannot be used: one line that names it and what is allowed.

tyro explains a mistake in a box with suggestions; its text names other options than the one that was mistyped, so the
option is looked for among those of the command first.
"""

import dataclasses
import difflib
import re
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import tyro

from endotsr.config import Config, allowed_values, refuse_unknown_keys
from endotsr.simulator.settings import SimulatorSettings

# What the dotted options of a command line start from.
ROOTS: dict[str, Any] = {f.name: f.type for f in msgspec.structs.fields(Config)} | {"simulator": SimulatorSettings}
POSITIONAL = get_args(tyro.conf.Positional[str])[1]
LIKE_ENOUGH = 0.7  # share of common letters from which an option is offered instead
LAST_NAME_ONLY = 0.95  # a setting named without its section is a little less alike than an option of that name
MOST_OFFERED = 3


def mistake_line(options: type, words: list[str], box: str, command: str) -> str:
    """One line for the mistake in `words`, which tyro explained in `box`.

    Raises: InputError naming the settings of a section, for a key that it does not have.
    """
    text = _plain_text(box)
    unknown = _unknown_option(options, words, text)
    if unknown is not None:
        return _no_such_option(unknown, options, command)
    choice = re.search(r"invalid choice ('[^']*') for argument '(--[\w.-]+)'", text)
    if choice and "." not in choice[2]:
        kind = _types(options).get(choice[2][2:].replace("-", "_"))
        return f"{choice[2]} {choice[1]} is not allowed; allowed: {', '.join(_choices(kind))}"
    named = re.search(r"--\w+(\.[\w-]+)+", text)
    if not named or setting_type(named[0]) is None:
        return text
    value = re.search(r"(?:instantiated from \[|choice |: )('[^']*')", text)
    given = f" = {value[1]}" if value else ""
    key = named[0][2:].replace("-", "_")
    return f"command line: {key}{given} is not allowed; allowed: {allowed_values(setting_type(named[0]))}"


def setting_type(word: str) -> Any:
    """The type of the setting that an option word such as `--model.beta` names, or None."""
    kind = ROOTS
    for name in word.removeprefix("--").replace("-", "_").split("."):
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            kind = {f.name: f.type for f in msgspec.structs.fields(kind)}
        kind = kind.get(name) if isinstance(kind, dict) else None
    return kind


def option_names(options: type) -> list[str]:
    """Every option of a command in the order of its help, those that switch off included."""
    names = ["--help"]
    for name, kind in _types(options).items():
        section, _, key = name.replace("_", "-").rpartition(".")
        section += "." if section else ""
        names += [f"--{section}{key}", *([f"--{section}no-{key}"] if kind is bool else [])]
    return names


def _types(kind: type, prefix: str = "") -> dict[str, Any]:
    """Dotted name -> type of every option; what stands without a name on the command line is left out."""
    found: dict[str, Any] = {}
    for name, annotated in get_type_hints(kind, include_extras=True).items():
        notes = get_args(annotated)[1:] if get_origin(annotated) is Annotated else ()
        plain = get_args(annotated)[0] if notes else annotated
        if isinstance(plain, type) and (issubclass(plain, msgspec.Struct) or dataclasses.is_dataclass(plain)):
            nameless = any(getattr(note, "name", None) == "" for note in notes)
            found |= _types(plain, prefix if nameless else f"{prefix}{name}.")
        elif POSITIONAL not in notes and tyro.conf.Positional not in notes:
            found[prefix + name] = plain
    return found


def _choices(kind: Any) -> list[str]:
    """The words that an option of this type may be, in the order in which they were declared."""
    if get_origin(kind) is Literal:
        return [str(choice) for choice in get_args(kind)]
    return [choice for part in get_args(kind) for choice in _choices(part)]


def _plain_text(box: str) -> str:
    """What stands in tyro's box, as one line without title and help; where the output takes no lines, it is dashes."""
    lines = [line.strip("│ ").strip() for line in box.splitlines() if not line.startswith(("╭", "╰"))]
    lines = [line for line in lines if line]
    titled = len(lines) > 1 and not lines[1].strip("-")
    lines = [line for line in lines[titled:] if line.strip("─-")]
    ends = ("For full help", "Argument helptext", "Got errors", "Perhaps you meant", "Arguments similar")
    end = next((i for i, line in enumerate(lines) if line.startswith(ends)), None)
    return " ".join(lines[:end])


def _unknown_option(options: type, words: list[str], text: str) -> str | None:
    """The first option that the command does not have, or else the first word that it has no place for."""
    names = set(option_names(options))
    for word in words:
        option = word.split("=")[0]
        if word.startswith("--") and option.replace("_", "-") not in names:
            return option
    said = re.match(r"Unrecognized options: (\S+?)(?:,|$)", text)
    return said[1] if said else None


def _no_such_option(option: str, options: type, command: str) -> str:
    names = option_names(options)
    if not option.startswith("-"):
        return f"{option!r}: one word too many; `endotsr {command} --help` lists the options"
    section, _, key = option.removeprefix("--").replace("-", "_").partition(".")
    if key and any("." in name for name in names):
        if section == "simulator":
            refuse_unknown_keys(_nested(key), SimulatorSettings, "command line", "simulator.")
        elif section != "preset":
            refuse_unknown_keys({section: _nested(key)}, Config, "command line")
    offered = _similar(option, names)
    advice = f"did you mean {' or '.join(offered)}?" if offered else f"`endotsr {command} --help` lists the options"
    return f"{option}: no such option; {advice}"


def _similar(option: str, names: list[str]) -> list[str]:
    """The options most like the one that was given; a setting is also found by its name without the section."""
    likeness = {}
    for name in names:
        last = "--" + name.removeprefix("--").rpartition(".")[2]
        alone = difflib.SequenceMatcher(None, option.replace("_", "-"), last).ratio()
        whole = difflib.SequenceMatcher(None, option.replace("_", "-"), name).ratio()
        likeness[name] = max(whole, LAST_NAME_ONLY * alone)
    best = max(likeness.values())
    return [name for name in names if likeness[name] == best >= LIKE_ENOUGH][:MOST_OFFERED]


def _nested(dotted: str) -> dict[str, Any]:
    first, _, rest = dotted.partition(".")
    return {first: _nested(rest) if rest else None}
