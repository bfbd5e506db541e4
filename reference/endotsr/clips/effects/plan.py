"""From verdicts to settings: components to switch off or reduce, with reasons and expected savings.

In: an `Inspection` and the configuration that would otherwise be used. Out: a `Plan`, a list of changed settings. A
plan never switches a component on and never adds a coefficient. It does not change the time bases: how many of them a
clip needs was not measured.
"""

from typing import Any, NamedTuple

import msgspec
import numpy as np

from endotsr.clips.effects.inspect import Inspection
from endotsr.clips.effects.savings import memory_fraction, time_fraction
from endotsr.clips.effects.verdict import UNKNOWN
from endotsr.clips.effects.views import harmonic_sizes
from endotsr.config import Config, config_from_dict
from endotsr.method.equations.dictionary import AtomReport, frequencies, report_atoms

MOST_CONDITION = 100.0  # of the dictionary at the training stamps; a larger one amplifies noise too much
SAMPLES_A_CYCLE = 2.0  # Nyquist limit: frames needed per cycle


class Change(NamedTuple):
    """One setting that the clip does not fully require."""

    key: str  # "model.appearance"
    value: Any
    before: Any
    reason: str  # one sentence
    effects: tuple[str, ...]  # verdicts on which the change is based
    time: float  # fraction of the time of an iteration that is expected to be saved
    memory: float  # fraction of the memory of Gaussians and optimiser that is saved
    given: bool = False  # the setting was given explicitly and is kept: nothing is saved


class Dictionary(NamedTuple):
    """The dictionary of equations (1)-(3) that the training stamps determine."""

    frequencies: int  # F
    frequency_max: float  # cycles per sequence
    rank: int
    condition: float
    configured: AtomReport  # of the dictionary of the configuration


class Plan(NamedTuple):
    """All changes, the kept settings with reasons, and remarks on effects without a component."""

    changes: tuple[Change, ...]
    kept: tuple[tuple[str, str], ...]  # setting and reason, for required components
    remarks: tuple[str, ...]
    dictionary: Dictionary
    time: float  # fraction of the time of an iteration that all changes together are expected to save
    memory: float


def make_plan(inspection: Inspection, config: Config, explicit: frozenset[str] = frozenset()) -> Plan:
    """The settings that the verdicts require.

    explicit   keys given on the command line or in a file; the plan keeps them and reports this
    """
    motion, light = inspection.verdicts["motion"], inspection.verdicts["photometric"]
    depth = inspection.verdicts["depth quality"]
    dictionary = carried(inspection, config)
    wanted: list[tuple[str, Any, str, tuple[str, ...]]] = [
        ("model.deformation", motion.present, motion.reason, ("motion",)),
        ("model.spectral_motion", *_spectral_motion(inspection, dictionary, config), ("motion",)),
        ("model.appearance", light.present, light.reason, ("photometric",)),
        ("model.exposure", light.present, light.reason, ("photometric",)),
        ("model.harmonics_degree", *_degree(inspection, config), ("view change", "motion")),
    ]
    if not depth.details["usable"]:
        wanted.append(("loss.depth_weight", 0.0, depth.reason, ("depth quality",)))
        wanted.append(("loss.smoothness_weight", 0.0, depth.reason, ("depth quality",)))
    about = (
        f"{inspection.clip.count} training stamps carry {dictionary.frequencies} frequencies up to "
        f"{dictionary.frequency_max:g} cycles (condition {dictionary.condition:.3g})."
    )
    wanted.append(("model.frequencies", dictionary.frequencies, about, ("motion", "photometric")))
    wanted.append(("model.frequency_max", dictionary.frequency_max, about, ("motion", "photometric")))
    plan = _assembled(wanted, config, explicit, inspection, dictionary)
    return plan._replace(changes=plan.changes + _colour_rate(plan, config, explicit, inspection))


def _colour_rate(plan: Plan, config: Config, explicit: frozenset[str], inspection: Inspection) -> tuple[Change, ...]:
    """The learning rate of the degree-0 coefficient that preserves the change of displayed colour per step of Adam.

    Adam moves every coefficient by about its rate, regardless of the gradient. Along one direction n, the coefficients
    h_k together move the colour by sum_k rate_k |Y_k(n)|. Without the higher degrees the colour would be learned more
    slowly.
    """
    lower = next((c for c in plan.changes if c.key == "model.harmonics_degree" and not c.given), None)
    base, rest = config.optimiser.harmonics_base, config.optimiser.harmonics_rest
    if lower is None or base <= 0:
        return ()
    sizes = harmonic_sizes(inspection.clip)
    removed = sizes[(lower.value + 1) ** 2 : (lower.before + 1) ** 2].sum()
    value = float(f"{base + rest * removed / sizes[0]:.4g}")
    reason = f"With degree {lower.value} this rate keeps the step of the displayed colour."
    given = "optimiser.harmonics_base" in explicit
    return (Change("optimiser.harmonics_base", value, base, reason, ("view change",), 0.0, 0.0, given),)


def _degree(inspection: Inspection, config: Config) -> tuple[int, str]:
    """The degree that the views determine if the tissue is static; all degrees if it moves.

    Moving tissue is seen from varying directions and turns relative to the lamp, and the harmonics can follow both.
    What they bring to such a clip was not measured.
    """
    views, motion = inspection.verdicts["view change"], inspection.verdicts["motion"]
    if motion.present:
        return config.model.harmonics_degree, f"{motion.reason[:-1]}: its view directions and its shading move along."
    return views.details["degree"], views.reason


def _assembled(
    wanted: list[tuple[str, Any, str, tuple[str, ...]]],
    config: Config,
    explicit: frozenset[str],
    inspection: Inspection,
    dictionary: Dictionary,
) -> Plan:
    """Sort the wanted settings into changes and kept settings. Changes apply in turn: their savings add up."""
    changes, kept, now = [], [], config
    for key, value, reason, effects in wanted:
        before = setting(now, key)
        value = min(before, value)  # never switched on, never larger
        spectral = key in ("model.frequencies", "model.frequency_max")
        if value == before or (spectral and not (now.model.appearance or now.model.spectral_motion)):
            if value and value == before and not spectral:
                kept.append((key, reason))
            continue
        if key in explicit:
            changes.append(Change(key, value, before, reason, effects, 0.0, 0.0, given=True))
            continue
        later = with_setting(now, key, value)
        saved = (time_fraction(now) - time_fraction(later), memory_fraction(now) - memory_fraction(later))
        changes.append(Change(key, value, before, reason, effects, *saved))
        now = later
    total = (1 - time_fraction(now) / time_fraction(config), 1 - memory_fraction(now) / memory_fraction(config))
    return Plan(tuple(changes), tuple(kept), _remarks(inspection), dictionary, *total)


def carried(inspection: Inspection, config: Config) -> Dictionary:
    """The largest part of the configured dictionary that the training stamps determine; else one frequency."""
    model, times = config.model, inspection.clip.times
    configured = report_atoms(times, frequencies(model.frequencies, model.frequency_min, model.frequency_max))
    nyquist = inspection.clip.frames / SAMPLES_A_CYCLE
    full = configured.rank == 2 * model.frequencies and configured.condition <= MOST_CONDITION
    if full and model.frequency_max <= nyquist:
        return Dictionary(model.frequencies, model.frequency_max, configured.rank, configured.condition, configured)
    highest = min(model.frequency_max, nyquist)
    highest = max(highest, 2 * model.frequency_min)
    for count in range(model.frequencies, 0, -1):
        for top in np.unique(np.round([highest, 0.9 * highest, 0.75 * highest], 2))[::-1]:
            if top <= model.frequency_min:
                continue
            report = report_atoms(times, frequencies(count, model.frequency_min, float(top)))
            if report.rank == 2 * count and report.condition <= MOST_CONDITION:
                return Dictionary(count, float(top), report.rank, report.condition, configured)
    report = report_atoms(times, frequencies(1, model.frequency_min, model.frequency_max))
    return Dictionary(1, model.frequency_max, report.rank, report.condition, configured)


def _spectral_motion(inspection: Inspection, dictionary: Dictionary, config: Config) -> tuple[bool, str]:
    """Whether a rate requires the Fourier translation, or any motion if tracks initialise it (B15).

    Motion that is assumed may have a rate.
    """
    motion = inspection.verdicts["motion"]
    if motion.kind == UNKNOWN:
        return True, motion.reason
    if motion.present and config.initialisation.motion != "none":
        return True, f"{motion.reason[:-1]}: the Gaussians start with the motion that flow shows."
    periodic = any(line.cycles <= dictionary.frequency_max for line in inspection.lines)
    if periodic or not inspection.lines:
        return periodic, motion.reason
    return False, f"The rates found exceed the {dictionary.frequency_max:g} cycles that the stamps can carry."


def _remarks(inspection: Inspection) -> tuple[str, ...]:
    """Findings that no component models."""
    verdicts = inspection.verdicts
    said = [
        f"{verdicts[name].reason} No component models it: leave these frames out or expect errors there."
        for name in ("topology change", "smoke", "blur")
        if verdicts[name].present
    ]
    camera, motion = verdicts["camera motion"], verdicts["motion"]
    if camera.present and camera.false_positive_rate is None:
        said.append("The camera moves, but its poses do not: a training takes its motion for motion of the tissue.")
    if motion.present and motion.kind != UNKNOWN:
        waves = motion.details["half_waves"]
        said.append(f"{waves} half waves over time hold 99 % of the motion; a time base resolves about one.")
    if verdicts["highlights"].present:
        said.append(f"{verdicts['highlights'].reason} Highlights that move are fitted as colour of the surface.")
    if not verdicts["occluders"].present:
        said.append("The masks exclude nothing: mask propagation costs nothing, and every pyramid pixel is valid.")
    highest = max((line.cycles for line in inspection.lines), default=0.0)
    if highest > inspection.clip.frames / SAMPLES_A_CYCLE / 2:
        said.append(f"A rate of {highest:.3g} cycles has fewer than four frames per cycle: more frames would help.")
    return tuple(said)


def setting(config: Config, key: str) -> Any:
    """The value of a dotted key."""
    section, name = key.split(".")
    return getattr(getattr(config, section), name)


def with_setting(config: Config, key: str, value: Any) -> Config:
    """The configuration with one setting changed, validated."""
    section, name = key.split(".")
    data = msgspec.to_builtins(config)
    data[section][name] = value
    return config_from_dict(data, "plan")


def apply_plan(plan: Plan, config: Config) -> tuple[Config, list[str]]:
    """The configuration with the changes of the plan, and one line for each."""
    lines = []
    for change in plan.changes:
        value, before = shown_value(change.value), shown_value(change.before)
        if change.given:
            lines.append(f"{change.key} = {before} is kept as given; the plan has {value}: {change.reason}")
            continue
        config = with_setting(config, change.key, change.value)
        lines.append(f"{change.key} = {value} (was {before}): {change.reason}")
    return config, lines


def shown_value(value: Any) -> str:
    """The value of a setting, as TOML has it."""
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"


def plan_record(plan: Plan) -> dict[str, Any]:
    """The plan as JSON-able data."""
    dictionary = plan.dictionary._asdict() | {"configured": plan.dictionary.configured._asdict()}
    return {
        "changes": [change._asdict() for change in plan.changes],
        "kept": [{"key": key, "reason": reason} for key, reason in plan.kept],
        "remarks": list(plan.remarks),
        "dictionary": dictionary,
        "time_saved": plan.time,
        "memory_saved": plan.memory,
    }
