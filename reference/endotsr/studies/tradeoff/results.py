"""The file of a measurement, `tradeoff.json`, and the types of its parts."""

from pathlib import Path
from typing import Annotated, TypedDict, cast

import msgspec

from endotsr.errors import InputError
from endotsr.training.runs.machine import MachinePart
from endotsr.untrusted.json import Keys, read_json

FORMAT = 1  # raised when a key changes its name or meaning


class Seconds(TypedDict):
    """Quartiles of the seconds per frame."""

    low: float
    median: float
    high: float


class ErrorPart(TypedDict):
    """Errors of a setting: largest and RMS of the colour in display units, and of the gradients, relative."""

    max: float
    rms: float
    gradient: float  # of the worst block
    gradients: dict[str, float]  # by block


class RasterPart(TypedDict):
    """The settings of the rasteriser that choose command-line options; the file holds the others too."""

    alpha_cutoff: float
    transmittance_stop: float
    alpha_max: float
    support: str
    jacobian_clamp: float


class SettingPart(TypedDict):
    """A setting, as far as it consists of command-line options."""

    raster: RasterPart
    precision: str
    scale: float


class Point(TypedDict):
    """One measured setting."""

    name: str
    file: str  # name of its arrays, where they are kept
    setting: SettingPart
    error: ErrorPart
    visits: int  # pixel-Gaussian pairs
    terms: int
    forward: Seconds
    both: Seconds  # with the reverse pass


class Fronts(TypedDict):
    """Names of the undominated points by cost."""

    forward: Annotated[list[str], msgspec.Meta(min_length=1)]
    both: list[str]
    visits: list[str]


class ScenePart(TypedDict):
    """The rendered scene."""

    name: str
    about: str
    gaussians: int
    width: int
    height: int
    degree: int
    bases: int
    frequencies: int
    log10_pairs: float


class LinesPart(TypedDict):
    """Errors drawn for comparison, in display units."""

    eight_bit: float
    sensor_noise: float | None


class Measurement(TypedDict):
    """What a study measures on a scene."""

    format: int
    scene: ScenePart
    reference: Keys
    lines: LinesPart
    points: list[Point]
    joint: list[str]
    presets: dict[str, str]
    fronts: Fronts
    repeats: int


class DatedMeasurement(Measurement):
    """tradeoff.json: the measurement with its time and machine."""

    date: str
    machine: MachinePart
    versions: dict[str, str]
    threads: int


def read_measurement(file: Path) -> DatedMeasurement:
    """Read a measurement. Raises InputError if it cannot be read, has another format, or lacks a key."""
    found = read_format(file)
    try:
        msgspec.convert(found, DatedMeasurement)
    except msgspec.ValidationError as error:
        raise InputError(f"{file}: incomplete measurement: {error}; measure again with another --out") from None
    measured = cast(DatedMeasurement, found)  # with the keys that only the file has
    if unknown := sorted(set(measured["fronts"]["forward"]) - {point["name"] for point in measured["points"]}):
        raise InputError(f"{file}: incomplete measurement: fronts.forward contains {unknown[0]!r}, which is no point")
    return measured


def read_format(file: Path) -> Keys:
    """Read a file of this format. Raises InputError if it cannot be read or has another format."""
    found = read_json(file)
    if found.get("format") != FORMAT:
        raise InputError(f"{file}: not a measurement of this version; measure again with another --out")
    return found
