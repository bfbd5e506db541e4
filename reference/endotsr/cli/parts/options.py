"""The settings of a run from preset, TOML file and command line.

Later sources override earlier ones: preset, TOML file, `--iterations` (stretches the schedule), other options. A source
that sets the length of the run sets it exactly: see `config.merged`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from endotsr.cli.parts.parser import given_keys, parse_known
from endotsr.config import (
    MILESTONES,
    Config,
    Preset,
    config_from_dict,
    with_iterations,
    with_settings,
)
from endotsr.errors import InputError
from endotsr.untrusted.toml import by_key, read_toml


@dataclass
class Sources:
    """The sources of the settings of a run."""

    preset: Preset | None = None
    config: Path | None = None
    iterations: int | None = None
    minutes: float | None = None
    schedule: Literal["stretched", "absolute"] | None = None  # None = stretched


def base_settings(words: list[str]) -> tuple[Config, str]:
    """The settings from preset, TOML file and `--iterations`, and a line on the schedule ("" = unchanged).

    The default preset is `paper`, with `--minutes` it is `sharp`.
    """
    sources = parse_known(Sources, words)
    data: dict[str, object] = {"preset": "paper" if sources.minutes is None else "sharp"}
    data = data | (read_toml(sources.config) if sources.config else {})
    if sources.preset:
        data = data | {"preset": sources.preset}
    config = config_from_dict(data, str(sources.config or "configuration"))
    if sources.iterations is None:
        return config, ""
    if sources.iterations < 1:
        raise InputError(f"--iterations {sources.iterations} is not allowed; use an integer >= 1")
    before = config.training.iterations
    if sources.schedule == "absolute":
        note = f"schedule: {sources.iterations} iterations, milestones at their absolute iterations"
        length = {"iterations": sources.iterations, "visits_per_frame": 0}
        return with_settings(config, training=length), note
    note = (
        f"schedule: stretched from {before} to {sources.iterations} iterations, every milestone keeps its fraction "
        "(--schedule absolute keeps their iterations)"
    )
    return with_iterations(config, sources.iterations), note if sources.iterations != before else ""


def asked_settings(options: type, words: list[str], wanted: Config, kept: Config) -> Config:
    """The settings `kept` of a run, changed where the command line or its TOML file sets a value.

    wanted   settings of a new run with these words, with the length for its number of frames
    """
    sources, named = parse_known(Sources, words), explicit_settings(options, words)
    if sources.iterations is not None or "training.visits_per_frame" in named:
        named |= {"training.iterations"}
    if sources.iterations is not None and sources.schedule is not None:
        named |= {f"{section}.{key}" for section, keys in MILESTONES.items() for key in keys}
    if sources.preset or (sources.config and "preset" in read_toml(sources.config)):
        named |= {"preset"}
    data, new = msgspec.to_builtins(kept), msgspec.to_builtins(wanted)
    for section, _, key in (name.partition(".") for name in named):
        if not key:
            data[section] = new[section]
        elif key in new[section]:  # a file may have keys of earlier versions
            data[section][key] = new[section][key]
    return config_from_dict(data, str(sources.config or "command line"))


def explicit_settings(options: type, words: list[str]) -> frozenset[str]:
    """Keys of the settings in the command line and its TOML file: `model.bases`. A preset does not count."""
    sources = parse_known(Sources, words)
    asked = read_toml(sources.config) if sources.config else {}
    return frozenset(key for key in by_key(asked).keys() | given_keys(options, words) if "." in key)


def differences(config: Config, other: Config, name: str) -> list[str]:
    """`section.key = value (name: other value)` for every setting that differs from `other`, called `name`."""
    ours, theirs = by_key(msgspec.to_builtins(config)), by_key(msgspec.to_builtins(other))
    return [f"{key} = {ours[key]!r} ({name}: {theirs[key]!r})" for key in ours if ours[key] != theirs[key]]
