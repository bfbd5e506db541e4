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
AS_ELSEWHERE = {  # words of other programs -> options of this package that mean the same, as far as a command has them
    "fps framerate frame-rate": ("--rate", "--source-rate"),
    "resize downscale downsample downscale-factor resolution-scale": ("--scale",),
    "epochs steps max-steps num-iterations max-iterations iters n-iters": ("--iterations",),
    "o output output-dir output-path output-folder save-dir dest model-path m": ("--out", "--film"),
    "start end start-frame end-frame first last skip stride every": ("--frames",),
    "fov hfov": ("--field-of-view",),
    "intrinsics k focal focal-length": ("--camera", "--calibration"),
    "poses extrinsics pose-file": ("--trajectory",),
    "force overwrite f y": ("--replace",),
    "invert invert-masks inverted": ("--excluded-value",),
    "workers num-workers num-threads jobs j": ("--threads",),
}
ELSEWHERE = {word: meant for words, meant in AS_ELSEWHERE.items() for word in words.split()}
SOURCE = "source source-path s input input-dir i data data-dir dataset video".split()
DEVICE = "gpu gpus cuda device".split()
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
    return InputError(f"{option}: no such option; {_advice(option, fields, names, command)}")


def _advice(option: str, fields: list[Field], names: list[str], command: str) -> str:
    """What to write in place of an unknown option; options of other programs are known by their meaning."""
    word = option.lstrip("-").replace("_", "-").lower()
    first = next((field for field in fields if field.positional), None)
    if word in SOURCE and first is not None:
        return f"write {first.name} without an option: `endotsr {command} {first.name}`"
    if word in DEVICE:
        more = "; --threads states how many" if "--threads" in names else ""
        return f"the computation is on the CPU{more}"
    offered = [name for name in ELSEWHERE.get(word, ()) if name in names] or _similar(option, names)
    return f"did you mean {' or '.join(offered)}?" if offered else f"`endotsr {command} --help` lists the options"


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
