"""SPEC.toml: the sequences, splits, configurations and seeds of a sweep, checked before anything runs.

    sequences = ["endonerf_pulling", "simulated"]    folders, relative to the folder of the file; or `simulated`
    seeds = [0, 1, 2]
    splits = ["every_eighth", "blocks 8"]            default: that of the settings
    measures = ["depth"]                             measured beside the held-out frames (`evaluation.measures`)
    preset = "paper"                                 iterations = 6000 stretches its schedule
    [settings.sequence]                              settings of every run
    scale = 0.5
    [configurations.base.model]                      settings of one configuration; at least one configuration
    appearance = false
    [configurations."A from base"]
    start = { configuration = "base", iteration = 3000 }   begins with that checkpoint, trained once for all seeds alike

The runs are all combinations. Order of the settings: preset < iterations < settings < configuration.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple, get_args

import msgspec

from endotsr.config import (
    PRESETS,
    Config,
    SequenceConfig,
    checked,
    config_from_dict,
    merged,
    refuse_unknown_keys,
    with_iterations,
    without_former_keys,
)
from endotsr.errors import InputError
from endotsr.evaluation.measures import check_measures
from endotsr.runs.sources import SIMULATED
from endotsr.simulator.settings import SimulatorSettings
from endotsr.untrusted.json import integer, listed, text
from endotsr.untrusted.toml import read_toml

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9+_. -]{0,60}")
KEYS = (
    "sequences", "seeds", "splits", "measures", "preset", "iterations", "lpips", "keep_checkpoints", "settings",
    "simulator", "configurations",
)  # fmt: skip
SPLITS = get_args(next(field.type for field in msgspec.structs.fields(SequenceConfig) if field.name == "split"))
LONGEST_BLOCK = 1 << 20  # frames
LARGEST = 1 << 53  # of a seed or a number of iterations


class Start(NamedTuple):
    """A run that begins with the state of another configuration at an iteration."""

    config: Config  # of that configuration, with the seed and the split of the run
    configuration: str
    iteration: int


class Configuration(NamedTuple):
    """Settings of the runs of one name; seed and split are still to be set."""

    name: str
    config: Config
    start: tuple[str, int] | None  # name of the configuration and iteration that it begins with


class Spec(NamedTuple):
    """A checked sweep."""

    sequences: tuple[str, ...]  # folders as absolute paths, or `simulated`
    seeds: tuple[int, ...]
    splits: tuple[str, ...]  # "every_eighth", "blocks 8", ...; empty = the one of the settings
    configurations: tuple[Configuration, ...]
    simulator: SimulatorSettings
    measures: tuple[str, ...] = ()
    lpips: str | None = None  # weights file, absolute
    keep_checkpoints: bool = True  # False: a run that is measured keeps its numbers and pictures only


def read_spec(path: Path) -> Spec:
    """A sweep from a file. Raises InputError naming the file, the key and what is allowed."""
    return spec_of(read_toml(path), str(path), Path(path).absolute().parent)


def spec_of(data: dict[str, Any], where: str, folder: Path) -> Spec:
    """A sweep from plain values.

    folder   paths are relative to it
    Raises:  InputError naming `where`, the key and what is allowed.
    """
    for key in data:
        if key not in KEYS:
            raise InputError(f"{where}: unknown key {key}; allowed: {', '.join(KEYS)}")
    for key in ("sequences", "configurations"):
        if key not in data:
            raise InputError(f"{where}: {key} is missing; allowed: at least one")
    sequences = tuple(_source(word, where, folder) for word in _texts(data["sequences"], f"{where}: sequences"))
    seeds = tuple(_seed(value, where) for value in listed(data.get("seeds", [0]), f"{where}: seeds"))
    splits = tuple(_split(word, where) for word in _texts(data.get("splits", []), f"{where}: splits", least=0))
    measures = _texts(data.get("measures", []), f"{where}: measures", least=0)
    check_measures(measures, f"{where}: measures =")
    for key, values in (("sequences", sequences), ("seeds", seeds), ("splits", splits)):
        if len(set(values)) < len(values) or (key == "seeds" and not values):
            raise InputError(f"{where}: {key}: one is named twice or none at all; allowed: each once")
    lpips = data.get("lpips")
    return Spec(
        sequences,
        seeds,
        splits,
        _configurations(data, where),
        _simulator(data.get("simulator", {}), where),
        measures,
        None if lpips is None else str(folder / text(lpips, f"{where}: lpips")),
        _switch(data.get("keep_checkpoints", True), f"{where}: keep_checkpoints"),
    )


def split_settings(split: str) -> dict[str, Any]:
    """The keys of the section `sequence` of a split: "blocks 4" -> {"split": "blocks", "block_length": 4}."""
    name, _, length = split.partition(" ")
    return {"split": name} | ({"block_length": int(length)} if length else {})


def split_name(settings: SequenceConfig) -> str:
    """The inverse of `split_settings`, for a table."""
    return f"{settings.split} {settings.block_length}" if settings.split in ("blocks", "end") else settings.split


def _configurations(data: dict[str, Any], where: str) -> tuple[Configuration, ...]:
    found = _table(data["configurations"], f"{where}: configurations")
    if not found:
        raise InputError(f"{where}: configurations: there is none; allowed: at least one table [configurations.NAME]")
    made = [_configuration(name, values, data, where) for name, values in found.items()]
    for configuration in made:
        if configuration.start and configuration.start[0] not in found:
            raise InputError(
                f"{where}: configurations.{configuration.name}.start.configuration = {configuration.start[0]!r} is "
                f"not allowed; allowed: {', '.join(found)}"
            )
    starts = {configuration.name: configuration.start for configuration in made}
    for name, start in starts.items():
        if start and starts[start[0]]:
            raise InputError(
                f"{where}: configurations.{name}.start: {start[0]} has a start itself; allowed: one without"
            )
    return tuple(made)


def _configuration(name: str, values: Any, data: dict[str, Any], where: str) -> Configuration:
    here = f"{where}: configurations.{name}"
    if not NAME.fullmatch(name):
        raise InputError(f"{here}: the name is not allowed; allowed: letters, digits, space, + - _ . (at most 61)")
    own = dict(_table(values, here))
    start = own.pop("start", None)
    preset = text(own.pop("preset", data.get("preset", "paper")), f"{here}: preset")
    iterations = own.pop("iterations", data.get("iterations"))
    if preset not in PRESETS:
        raise InputError(f"{here}: preset = {preset!r} is not allowed; allowed: {', '.join(PRESETS)}")
    config = PRESETS[preset]
    if iterations is not None:
        config = with_iterations(config, integer(iterations, f"{here}: iterations", low=1, high=LARGEST))
    for changes in (_table(data.get("settings", {}), f"{where}: settings"), own):
        config = _changed(config, changes, here)
    return Configuration(name, config, None if start is None else _start(start, f"{here}.start", config))


def _changed(config: Config, changes: dict[str, Any], where: str) -> Config:
    changes = without_former_keys(changes, where, config.training.bridge_fraction)
    refuse_unknown_keys(changes, Config, where)
    for section, values in changes.items():
        if section == "preset":
            raise InputError(f"{where}: settings.preset is not allowed; allowed: preset beside settings")
        _table(values, f"{where}: {section}")
    return config_from_dict(merged(msgspec.to_builtins(config), changes), where)


def _start(value: Any, where: str, config: Config) -> tuple[str, int]:
    found = _table(value, where)
    if set(found) != {"configuration", "iteration"}:
        raise InputError(f"{where}: has the keys {', '.join(found) or 'none'}; allowed: configuration, iteration")
    last = config.training.iterations - 1
    return text(found["configuration"], where), integer(found["iteration"], f"{where}.iteration", low=1, high=last)


def _seed(value: Any, where: str) -> int:
    return integer(value, f"{where}: seeds", low=0, high=LARGEST)


def _split(word: str, where: str) -> str:
    name, space, length = word.partition(" ")
    allowed = ", ".join(f"{s} N" if s in ("blocks", "end") else s for s in SPLITS)
    if name not in SPLITS or (name in ("blocks", "end")) != bool(space):
        raise InputError(f"{where}: splits = {word!r} is not allowed; allowed: {allowed}")
    if space and not (length.isascii() and length.isdigit() and 1 <= int(length) <= LONGEST_BLOCK):
        raise InputError(f"{where}: splits = {word!r} is not allowed; allowed: {allowed}, with N >= 1")
    return f"{name} {int(length)}" if space else name


def _source(word: str, where: str, folder: Path) -> str:
    if word == SIMULATED:
        return word
    try:
        found = (folder / word).resolve()
        there = found.is_dir()
    except (OSError, RuntimeError):  # a name that is too long, links that lead round in a circle
        found, there = folder, False
    if not there:
        raise InputError(f"{where}: sequences = {word!r} is not allowed; allowed: a folder, or {SIMULATED}")
    return str(found)


def _simulator(value: Any, where: str) -> SimulatorSettings:
    found = _table(value, f"{where}: simulator")
    refuse_unknown_keys(found, SimulatorSettings, where, "simulator.")
    return checked(found, SimulatorSettings, where, "simulator.")


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} = {value!r} is not allowed; allowed: a table of keys")
    return value


def _texts(value: Any, where: str, least: int = 1) -> tuple[str, ...]:
    found = tuple(text(word, where) for word in listed(value, where))
    if len(found) < least:
        raise InputError(f"{where}: the list is empty; allowed: at least one")
    return found


def _switch(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{where} = {value!r} is not allowed; allowed: true, false")
    return value
