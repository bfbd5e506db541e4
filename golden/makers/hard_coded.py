"""Settings that a port must not hard-code: their values in the cases, and a case that rejects each fixed value.

In: the golden cases. Out: for every setting of the configuration and of the rasteriser, its values in the cases, and
for each of these values and the published one, a case that rejects a port with this fixed value. Such a port is the
reference with the one setting replaced. A value that no case rejects is a gap.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.method.splatting.settings import PRESETS, RasterSettings
from endotsr.port.contract import all_operations
from endotsr.port.judge.compare import judged
from endotsr.port.judge.format import Case
from endotsr.port.judge.store import Golden
from endotsr.port.reference import reference, stored
from endotsr.port.search.requests import with_value
from makers.registry import DECLARED

Place = tuple[str, ...]  # keys of the settings of a case, from the outside in

SECTIONS = ("model", "raster", "loss", "optimiser", "density", "initialisation", "training")
GENERAL = {
    "raster.preset": "the name of eleven values, each of which is a setting of the cases",
    "training.threads": "changes no result",
    "training.precision": "the precision is that of the request",
    "training.checkpoint_every": "changes no result",
}
"""Settings of no operation that no case must vary, with the reason; `preset` and `sequence` belong to the reader."""
REMEDIES = (
    "give it two values in the cases of golden/makers/objective.py or of its own family, or add a line '{}' with the"
    " reason to `free` of its operation in that family; a setting of no operation to GENERAL of"
    " golden/makers/hard_coded.py"
)


class Row(NamedTuple):
    """A setting, and for each value a case that rejects a port with this fixed value; "" if there is none."""

    setting: str
    refused_by: dict[str, str]

    @property
    def gaps(self) -> list[str]:
        """Values that a port could hard-code undetected."""
        return [value for value, case in self.refused_by.items() if not case]

    @property
    def fault(self) -> str:
        """What the cases do not show of the setting, with both remedies; "" if they show all of it."""
        few, remedies = len(self.refused_by) < 2, REMEDIES.format(self.setting)
        if few or self.gaps:
            only = f"the cases give {list(self.refused_by)} only"
            return f"{self.setting}: {only if few else f'a port that always uses {self.gaps} passes'}; {remedies}"
        return ""


def _free() -> dict[str, str]:
    """Settings that no case must vary, with the reason, in the order of the configuration."""
    found = GENERAL | {name: reason for operation in DECLARED.values() for name, reason in operation.free.items()}
    config = msgspec.to_builtins(Config())
    place = {name: k for k, name in enumerate(f"{section}.{key}" for section in SECTIONS for key in config[section])}
    return dict(sorted(found.items(), key=lambda one: place.get(one[0], len(place))))


FREE = _free()


def wanted_settings() -> dict[str, Any]:
    """Every setting that a case must vary, with its published value."""
    config = msgspec.to_builtins(Config())
    found = {f"{section}.{key}": value for section in SECTIONS for key, value in config[section].items()}
    raster = RasterSettings()._asdict()
    deviations = raster.pop("deviations")._asdict()
    found |= {f"raster.{key}": value for key, value in raster.items()}
    found |= {f"raster.deviations.{key}": value for key, value in deviations.items()}
    return {name: value for name, value in found.items() if name not in FREE}


def places(case: Case, setting: str) -> Iterator[Place]:
    """Locations of a setting in the settings of a case."""
    path = tuple(setting.split("."))
    for start in ((), ("config",)):
        if _at(case.settings, (*start, *path)) is not None:
            yield (*start, *path)
    for key in case.settings:
        if DECLARED[case.operation].settings.get(key) == setting:
            yield (key,)


def _at(settings: Mapping[str, Any], place: Place) -> Any:
    """The value of a setting, resolved through its preset; None if missing."""
    value: Any = settings
    for key in place:
        if not isinstance(value, Mapping) or key not in value:
            return None
        value = value[key]
    return getattr(PRESETS[settings["config"]["raster"]["preset"]], place[-1]) if value == "preset" else value


def refuses(golden: Golden, case: Case, settings: dict[str, Any], precision: str) -> bool:
    """Whether a case rejects the reference with other settings."""
    with np.errstate(all="ignore"):
        try:
            found = reference(all_operations()[case.operation], golden.inputs(case), settings, precision, "definition")
        except (InputError, ValueError, IndexError, AssertionError):
            return True
    for name, output in case.outputs.items():
        answers = [golden.array(case, output.answer(k)) for k in range(case.answers)]
        got = stored(found[name]) if name in found else None
        if got is None or not any(
            got.shape == right.shape and judged(got, right, output.compare, precision).passed for right in answers
        ):
            return True
    return False


def held_by(golden: Golden, setting: str) -> list[tuple[Case, Place]]:
    """The cases that state a setting, with the place of it."""
    return [(case, place) for case in golden.cases for place in places(case, setting)]


def values_of(held: list[tuple[Case, Place]], published: Any) -> dict[str, Any]:
    """The published value of a setting and those of the cases, each once, by its text."""
    return {msgspec.json.encode(v).decode(): v for v in (published, *(_at(c.settings, p) for c, p in held))}


def row_of(golden: Golden, setting: str, published: Any, precision: str = "float64") -> Row:
    """Every value of a setting in the cases, and the published one, with the first case that rejects it."""
    held = held_by(golden, setting)
    refused = {}
    for text, value in values_of(held, published).items():
        others = [(case, place) for case, place in held if _at(case.settings, place) != value]
        wrong = (c.name for c, p in others if refuses(golden, c, dict(with_value(c.settings, p, value)), precision))
        refused[text] = next(wrong, "")
    return Row(setting, refused)


def table(golden: Golden, precision: str = "float64") -> list[Row]:
    """A row for every setting that a case must vary."""
    order = sorted(golden.cases, key=lambda case: case.level)
    return [row_of(golden._replace(cases=order), name, value, precision) for name, value in wanted_settings().items()]
