"""The settings of a case as stored: with the keys of the configuration at the time of their generation.

Ports read these keys, so a key removed from the configuration stays in the cases, at its remaining value.
"""

from typing import Any

import msgspec

from endotsr.config import Config, InitialisationConfig

KEPT: dict[str, dict[str, dict[str, Any]]] = {
    "initialisation": {"motion": {"motion_flow": "dis"}},
    "training": {
        "harmonics_interval": {"time_jitter": 0.0},
        "bridge_fraction": {"bridge_target": "neighbour", "bridge_flow": "dis"},
    },
}
"""Section -> key -> the keys that follow it in a case."""


def written(config: Config) -> dict[str, Any]:
    """All settings."""
    return {name: _with_kept(name, values) for name, values in msgspec.to_builtins(config).items()}


def written_initialisation(config: InitialisationConfig) -> dict[str, Any]:
    """The settings of the initialisation."""
    return _with_kept("initialisation", msgspec.to_builtins(config))


def _with_kept(section: str, values: Any) -> Any:
    if section not in KEPT:
        return values
    out: dict[str, Any] = {}
    for key, value in values.items():
        out |= {key: value} | KEPT[section].get(key, {})
    return out
