"""SPEC.toml: the sequences, splits, configurations and seeds of a sweep, checked before anything runs.

    sequences = ["endonerf_pulling", "simulated"]    folders, relative to the folder of the file; or `simulated`
    seeds = [0, 1, 2]
    splits = ["every_eighth", "blocks 8"]            default: that of the settings
    measures = ["depth"]                             additional measurements (`evaluation.measures`)
    preset = "paper"                                 iterations = 6000 stretches its schedule
    [settings.sequence]                              settings of every run
    scale = 0.5
    [configurations.base.model]                      settings of one configuration; at least one configuration
    appearance = false
    [configurations."A from base"]
    start = { configuration = "base", iteration = 3000 }   starts from that checkpoint, trained once per seed

The runs are all combinations. Later settings override earlier ones: preset, iterations, settings, configuration.
"""

import re
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args

import msgspec

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import Config, SequenceConfig, config_from_dict, merged, with_iterations, without_former_keys
from endotsr.errors import InputError
from endotsr.results.evaluation.measures import check_measures
from endotsr.training.runs.sources import SIMULATED
from endotsr.untrusted.json import Keys, Text, integer
from endotsr.untrusted.names import choice
from endotsr.untrusted.sections import Section, checked, refuse_unknown_keys
from endotsr.untrusted.toml import by_key, read_toml

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9+_. -]{0,60}")
SPLITS = get_args(next(field.type for field in msgspec.structs.fields(SequenceConfig) if field.name == "split"))
NEEDED = {  # what a file lacks -> what to write
    "sequences": 'use a list of folders, such as sequences = ["my_sequence"]',
    "configurations": "use one or more, such as the line [configurations.base] for the settings without a change",
}
LONGEST_BLOCK = 1 << 20  # frames
Seed = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
Iteration = Annotated[int, msgspec.Meta(ge=1, le=1 << 53)]


class StartAt(Section, frozen=True, kw_only=True):
    """The configuration and iteration whose state a run starts from."""

    configuration: Text
    iteration: Iteration


class ConfigurationKeys(Section, frozen=True, kw_only=True):
    """The keys of a configuration other than its settings."""

    preset: Text | None = None
    iterations: Iteration | None = None
    start: StartAt | None = None


class SpecFile(Section, frozen=True, kw_only=True):
    """The keys of SPEC.toml."""

    sequences: Annotated[tuple[Text, ...], msgspec.Meta(min_length=1)]
    seeds: Annotated[tuple[Seed, ...], msgspec.Meta(min_length=1)] = (0,)
    splits: tuple[Text, ...] = ()
    measures: tuple[Text, ...] = ()
    preset: Text = "paper"
    iterations: Iteration | None = None
    lpips: Text | None = None
    keep_checkpoints: bool = True
    settings: Keys = msgspec.field(default_factory=dict)
    simulator: SimulatorSettings = SimulatorSettings()
    configurations: Annotated[Keys, msgspec.Meta(min_length=1)]


class Start(NamedTuple):
    """The start of a run from the state of another configuration."""

    config: Config  # of that configuration, with the seed and split of the run
    configuration: str
    iteration: int


class Configuration(NamedTuple):
    """A named configuration; each run adds its seed and split."""

    name: str
    config: Config
    start: StartAt | None


class Spec(NamedTuple):
    """A checked sweep."""

    sequences: tuple[str, ...]  # folders as absolute paths, or `simulated`
    seeds: tuple[int, ...]
    splits: tuple[str, ...]  # "every_eighth", "blocks 8", ...; empty = the split of the settings
    configurations: tuple[Configuration, ...]
    simulator: SimulatorSettings
    measures: tuple[str, ...] = ()
    lpips: str | None = None  # weights file, absolute
    keep_checkpoints: bool = True  # False: an evaluated run keeps only its numbers and pictures


def read_spec(path: Path) -> Spec:
    """A sweep from a file. Raises InputError naming the file, the key and the allowed values."""
    return spec_of(read_toml(path), str(path), Path(path).absolute().parent)


def spec_of(data: Keys, where: str, folder: Path) -> Spec:
    """A sweep from plain values.

    folder   base of relative paths
    Raises:  InputError naming `where`, the key and the allowed values.
    """
    refuse_unknown_keys(data, SpecFile, where)
    for key, remedy in NEEDED.items():
        if key not in data:
            raise InputError(f"{where}: {key} is missing; {remedy}")
    file = checked(data, SpecFile, where)
    sequences = tuple(_source(word, where, folder) for word in file.sequences)
    splits = tuple(_split(word, where) for word in file.splits)
    check_measures(file.measures, f"{where}: measures =")
    for key, values in (("sequences", sequences), ("seeds", file.seeds), ("splits", splits)):
        if len(set(values)) < len(values):
            raise InputError(f"{where}: {key}: duplicate entry; use each once")
    made, lpips = _configurations(file, where), None if file.lpips is None else str(folder / file.lpips)
    return Spec(sequences, file.seeds, splits, made, file.simulator, file.measures, lpips, file.keep_checkpoints)


def split_settings(split: str) -> Keys:
    """The settings of section `sequence` for a split: "blocks 4" -> {"split": "blocks", "block_length": 4}."""
    name, _, length = split.partition(" ")
    return {"split": name} | ({"block_length": int(length)} if length else {})


def split_name(settings: SequenceConfig) -> str:
    """The inverse of `split_settings`."""
    return f"{settings.split} {settings.block_length}" if settings.split in ("blocks", "end") else settings.split


def _configurations(file: SpecFile, where: str) -> tuple[Configuration, ...]:
    made = tuple(_configuration(name, values, file, where) for name, values in file.configurations.items())
    starts = {configuration.name: configuration.start for configuration in made}
    for name, start in starts.items():
        here = f"{where}: configurations.{name}.start"
        if start and start.configuration not in starts:
            allowed = choice(starts)
            raise InputError(f"{here}.configuration = {start.configuration!r} is not allowed; use {allowed}")
        if start and starts[start.configuration]:
            raise InputError(f"{here}: {start.configuration} has its own start; use a configuration without start")
    return made


def _configuration(name: str, values: Any, file: SpecFile, where: str) -> Configuration:
    here = f"{where}: configurations.{name}"
    if not NAME.fullmatch(name):
        raise InputError(f"{here}: the name is not allowed; use letters, digits, space, + - _ . (at most 61)")
    if not isinstance(values, dict):
        raise InputError(f"{here} = {values!r} is not allowed; use a table of keys")
    own = ConfigurationKeys.__struct_fields__
    keys = checked({key: value for key, value in values.items() if key in own}, ConfigurationKeys, here)
    config = config_from_dict({"preset": file.preset if keys.preset is None else keys.preset}, here)
    if iterations := keys.iterations or file.iterations:
        config = with_iterations(config, iterations)
    for changes in (file.settings, {key: value for key, value in values.items() if key not in own}):
        _refuse_overridden(changes, file, here)
        config = _changed(config, changes, here)
    if keys.start:
        integer(keys.start.iteration, f"{here}.start.iteration", low=1, high=config.training.iterations - 1)
    return Configuration(name, config, keys.start)


def _refuse_overridden(changes: Keys, file: SpecFile, where: str) -> None:
    """Raises InputError for a setting that the seeds and splits of the sweep replace in every run."""
    for key, instead in (("training.seed", "seeds"), ("sequence.split", "splits")):
        if key in by_key(changes) and getattr(file, instead):
            raise InputError(f"{where}: {key} has no effect: {instead} sets it in every run; use {instead} alone")


def _changed(config: Config, changes: Keys, where: str) -> Config:
    if "preset" in changes:
        raise InputError(f"{where}: settings.preset is not allowed; use preset next to settings")
    changes = without_former_keys(changes, where, config.training.bridge_fraction)
    refuse_unknown_keys(changes, Config, where)
    return config_from_dict(merged(msgspec.to_builtins(config), changes), where)


def _split(word: str, where: str) -> str:
    name, space, length = word.partition(" ")
    allowed = choice(f"{s} N" if s in ("blocks", "end") else s for s in SPLITS)
    if name not in SPLITS or (name in ("blocks", "end")) != bool(space):
        raise InputError(f"{where}: splits = {word!r} is not allowed; use {allowed}")
    if space and not (length.isascii() and length.isdigit() and 1 <= int(length) <= LONGEST_BLOCK):
        raise InputError(f"{where}: splits = {word!r} is not allowed; use {allowed}, with N >= 1")
    return f"{name} {int(length)}" if space else name


def _source(word: str, where: str, folder: Path) -> str:
    if word == SIMULATED:
        return word
    try:
        found = (folder / word).resolve()
        there = found.is_dir()
    except (OSError, RuntimeError):  # a name that is too long, or a cycle of links
        found, there = folder, False
    if not there:
        raise InputError(f"{where}: sequences = {word!r} is not allowed; use a folder, or {SIMULATED}")
    return str(found)
