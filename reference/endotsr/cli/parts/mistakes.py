"""Errors for unknown words of a command line: one line with the likely option, or the keys of the section."""

import difflib
import os

from endotsr.cli.parts.fields import Field
from endotsr.errors import InputError
from endotsr.untrusted.json import Keys
from endotsr.untrusted.sections import unknown_key

LIKE_ENOUGH = 0.7  # minimum similarity of a suggested option
LAST_NAME_ONLY = 0.95  # factor for a setting named without its section, to prefer an option of that name
MOST_OFFERED = 3
OF_PICTURE, SIDES = ("--size", "--resolution"), ("--width", "--height")  # words for both sides of a picture
OTHER_DASHES = "\N{EM DASH}\N{EN DASH}\N{MINUS SIGN}"  # that text programs make of hyphens


def unknown_word(fields: list[Field], words: list[str], command: str, has_result: bool = False) -> InputError:
    """The error for words that belong to no option; it names the first unknown option, or else the first word.

    has_result   whether the line has an --out, so that the word is not the folder of the result
    """
    option = next((word.split("=")[0] for word in words if word.startswith("-")), None)
    names = option_names(fields)
    if option is None:
        if os.path.exists(words[0]) and any(field.positional for field in fields):
            return InputError(f"{words[0]!r}: a second path; give one, such as the folder that holds all pictures")
        result = f"if the result goes there: --out {words[0]}; " if "--out" in names and not has_result else ""
        return InputError(f"{words[0]!r}: unexpected argument; {result}`endotsr {command} --help` lists the options")
    if os.path.lexists(option):
        return InputError(f"{option}: no such option; for the file or folder of this name, write ./{option}")
    unknown_key = _unknown_key(fields, option)
    if unknown_key:
        return InputError(f"command line: {unknown_key}")
    if option in OF_PICTURE and set(SIDES) <= set(names):
        return InputError(f"{option}: no such option; use {' and '.join(SIDES)}")
    offered = _similar(option, names)
    advice = f"did you mean {' or '.join(offered)}?" if offered else f"`endotsr {command} --help` lists the options"
    return InputError(f"{option}: no such option; {advice}")


def refuse_other_dashes(fields: list[Field], words: list[str]) -> None:
    """Refuse an option whose two hyphens have become a dash, as in text that was copied from a text program."""
    names = option_names(fields)
    for word in words:
        meant = "--" + word.split("=")[0].lstrip(f"{OTHER_DASHES}-")
        if word.startswith(tuple(OTHER_DASHES)) and meant in names:
            raise InputError(f"{word}: begins with a dash in place of two hyphens; did you mean {meant}?")


def option_names(fields: list[Field]) -> list[str]:
    """Every option of a command in the order of its help, including negated switches."""
    names = [[field.name, field.off] if field.switch else [field.name] for field in fields if not field.positional]
    return ["--help", *(name for both in names for name in both)]


def _unknown_key(fields: list[Field], option: str) -> str:
    """The unknown part of a dotted option with the allowed keys; "" without a dot or without sections."""
    keys: Keys = {}
    for field in (field for field in fields if not field.positional):
        tree = keys
        *sections, last = field.key.split(".")
        for name in sections:
            tree = tree.setdefault(name, {})
        if sections:
            tree[last] = None
    path = option.removeprefix("--").replace("-", "_").split(".")
    if len(path) < 2 or not keys:
        return ""
    for depth, name in enumerate(path):
        if name not in keys:
            return unknown_key(name, keys, "".join(f"{section}." for section in path[:depth]))
        if keys[name] is None:
            break
        keys = keys[name]
    return ""


def _similar(option: str, names: list[str]) -> list[str]:
    """The most similar options; a setting also matches by its name without the section."""
    likeness = {}
    for name in names:
        last = "--" + name.removeprefix("--").rpartition(".")[2]
        alone = difflib.SequenceMatcher(None, option.replace("_", "-"), last).ratio()
        whole = difflib.SequenceMatcher(None, option.replace("_", "-"), name).ratio()
        likeness[name] = max(whole, LAST_NAME_ONLY * alone)
    best = max(likeness.values())
    return [name for name in names if likeness[name] == best >= LIKE_ENOUGH][:MOST_OFFERED]
