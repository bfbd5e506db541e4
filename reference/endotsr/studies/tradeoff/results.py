"""The file of a measurement, `tradeoff.json`."""

from pathlib import Path
from typing import Annotated, Any

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.json import read_json

FORMAT = 1  # raised when a key changes its name or meaning


class Seconds(msgspec.Struct):
    """Quartiles of the seconds per frame."""

    median: float
    high: float


class Errors(msgspec.Struct):
    """Errors of a setting."""

    max: float
    rms: float
    gradient: float


class Raster(msgspec.Struct):
    """The rasteriser settings that are command-line options."""

    alpha_cutoff: float
    transmittance_stop: float
    alpha_max: float
    support: str


class ChosenSetting(msgspec.Struct):
    """A setting, as far as it consists of command-line options."""

    raster: Raster
    precision: str
    scale: float


class Point(msgspec.Struct):
    """One measured setting."""

    name: str
    setting: ChosenSetting
    error: Errors
    forward: Seconds
    both: Seconds


class Front(msgspec.Struct):
    """Names of the undominated points."""

    forward: Annotated[list[str], msgspec.Meta(min_length=1)]


class SceneSize(msgspec.Struct):
    """The rendered scene."""

    name: str
    gaussians: int
    width: int
    height: int


class Measurement(msgspec.Struct):
    """The keys of tradeoff.json that a budget reads."""

    scene: SceneSize
    points: list[Point]
    fronts: Front

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.fronts.forward) - {point.name for point in self.points}):
            raise ValueError(f"fronts.forward contains {unknown[0]!r}, which is no point")


def read_result(file: Path, needed: type[msgspec.Struct] | None = None) -> dict[str, Any]:
    """Read a measurement.

    needed   the required keys with their types; None = check the format only
    Raises:  InputError if it cannot be read, has another format, or lacks a key.
    """
    found = read_json(file)
    if found.get("format") != FORMAT:
        raise InputError(f"{file}: not a measurement of this version; measure again with another --out")
    if needed is not None:
        try:
            msgspec.convert(found, needed)
        except msgspec.ValidationError as error:
            raise InputError(f"{file}: incomplete measurement: {error}; measure again with another --out") from None
    return found
