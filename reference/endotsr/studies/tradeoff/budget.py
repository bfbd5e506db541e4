"""`--budget`: a limit on time or error, and the best measured setting within it.

Allowed: a time per frame (`10 ms`, `0.1 s`, `30 fps`), or an error (`1/255`, `0.5/255`, `1e-3`, in display units).
"""

import math
import re
from typing import Literal, NamedTuple

from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.method.splatting.settings import PRESETS
from endotsr.studies.tradeoff.results import Measurement, Point, SettingPart
from endotsr.studies.tradeoff.text import levels, milliseconds

Kind = Literal["frame", "error"]

NUMBER = r"(\d+\.?\d*(?:e[+-]?\d+)?|\.\d+)"
FORMS = 'a time per frame ("10 ms", "0.1 s", "30 fps") or an error ("1/255", "1e-3")'
FACTORS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}


class Budget(NamedTuple):
    """A limit: seconds per frame, or largest error in display units."""

    kind: Kind
    amount: float
    text: str


class Advice(NamedTuple):
    """A measured setting within a budget."""

    point: Point
    lines: list[str]


def parse_budget(text: str) -> Budget:
    """Parse a budget. Raises InputError naming the allowed forms."""
    plain = " ".join(text.lower().split())
    found = None
    if fraction := re.fullmatch(rf"{NUMBER} ?/ ?{NUMBER}", plain):
        found = Budget("error", _quotient(*map(float, fraction.groups())), text)
    elif quantity := re.fullmatch(rf"{NUMBER} ?(us|ms|s|fps)?", plain):
        amount, unit = float(quantity[1]), quantity[2]
        if unit is None:
            found = Budget("error", amount, text)
        elif unit == "fps":
            found = Budget("frame", _quotient(1.0, amount), text)
        else:
            found = Budget("frame", amount * FACTORS[unit], text)
    if found is None or not 0 < found.amount < math.inf:
        raise InputError(f"--budget {text!r} is not understood; use {FORMS}, each finite and > 0")
    return found


def _quotient(numerator: float, denominator: float) -> float:
    """The quotient; infinity, which `parse_budget` refuses, for a denominator of 0."""
    return numerator / denominator if denominator else math.inf


def frame_advice(result: Measurement, budget: Budget) -> Advice:
    """The best setting within the budget, with what to expect. Raises InputError as `best_point`, naming the option."""
    try:
        chosen = best_point(result, budget)
    except InputError as error:
        raise InputError(f"--budget {budget.text}: {error}") from None
    where = f"measured on {_scene(result)}"
    return Advice(chosen, [f"{budget.text}: {chosen['name']}", *_expectation(chosen), where])


def _scene(result: Measurement) -> str:
    about = result["scene"]
    return f"{about['gaussians']} Gaussians at {about['width']}x{about['height']} ({about['name']})"


def best_point(result: Measurement, budget: Budget) -> Point:
    """The point of the best setting within the budget.

    For a time budget: of the presets and the joint sweep, the most accurate setting with its upper quartile within the
    budget, which need not be on the front of error against the median time. For an error budget: the setting with the
    least median time and its largest error within the budget, which is on that front.

    Raises:  InputError with the reason if there is none.
    """
    by_name = {p["name"]: p for p in result["points"]}
    front = [by_name[name] for name in result["fronts"]["forward"]]
    if budget.kind == "frame":
        names = dict.fromkeys((*result["fronts"]["forward"], *result["joint"], *result["presets"].values()))
        swept = [by_name[name] for name in names if name in by_name]
        kept = [p for p in swept if p["forward"]["high"] <= budget.amount]
        if not kept:
            least = min(swept, key=lambda p: p["forward"]["high"])
            raise InputError(
                f"no measured setting renders {_scene(result)} that fast in its upper quartile; the smallest is of "
                f"{least['name']}, {milliseconds(least['forward']['high'])}; fewer Gaussians or pixels are faster"
            )
        return min(kept, key=lambda p: (p["error"]["max"], p["forward"]["high"]))
    kept = [p for p in front if p["error"]["max"] <= budget.amount]
    if not kept:
        best = min(front, key=lambda p: p["error"]["max"])
        raise InputError(
            f"no measured setting reaches this error on {_scene(result)}; the most accurate is "
            f"{best['name']} with a largest error of {best['error']['max']:.2g}"
        )
    return min(kept, key=lambda p: p["forward"]["median"])


def _expectation(point: Point) -> list[str]:
    error = point["error"]
    return [
        f"expected error: largest {levels(error['max'])}, RMS {levels(error['rms'])}, "
        f"worst gradient block {error['gradient']:.2g} (relative)",
        f"expected time: {milliseconds(point['forward']['median'])} per frame, "
        f"{milliseconds(point['both']['median'])} with the reverse pass",
        f"as settings: {settings_words(point['setting'])}{clamp_note(point['setting'])}",
    ]


def settings_words(setting: SettingPart) -> str:
    """The options of `endotsr train` for a setting, without those whose value is the default; at least the preset."""
    raster, preset = setting["raster"], _preset(setting)
    words = [] if preset == "paper" else [f"--raster.preset {preset}"]
    for key, digits in (("alpha_cutoff", 4), ("transmittance_stop", 4), ("alpha_max", 7)):
        if raster[key] != getattr(PRESETS[preset], key):
            words.append(f"--raster.{key.replace('_', '-')} {raster[key]:.{digits}g}")
    if setting["precision"] != PAPER.training.precision:
        words.append(f"--training.precision {setting['precision']}")
    if setting["scale"] != 1:
        words.append(f"--scale {setting['scale']:g}")
    return " ".join(words or ["--raster.preset paper"])


def _preset(setting: SettingPart) -> str:
    """The preset of the rasteriser with the support of a setting, which has no option of its own."""
    return {"everywhere": "exact", "three_sigma_tiles": "legacy"}.get(setting["raster"]["support"], "paper")


def clamp_note(setting: SettingPart) -> str:
    """What the options keep of their preset although the setting was measured without it; no option changes it."""
    kept = PRESETS[_preset(setting)].jacobian_clamp
    if setting["raster"]["jacobian_clamp"] == kept:
        return ""
    return f" (they keep the Jacobian clamp {kept:g} of {_preset(setting)}, with which the setting was not measured)"
