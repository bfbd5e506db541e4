"""The studies of error against time as text: advice, dominated presets, and the table of the trainings."""

from collections.abc import Sequence
from typing import Any

from endotsr.results.report.tables import duration
from endotsr.studies.tradeoff.study import Ranked, dominates
from endotsr.studies.tradeoff.text import levels, milliseconds, small

# Dominated presets with the reason to keep them. A test fails for a dominated preset without a reason.
KEPT = {
    "legacy": "reproduces the released CUDA program, its three-sigma tiles and its gradients, for comparison",
}


def advice(result: dict[str, Any]) -> list[str]:
    """Three sentences of advice, each with the figures of this measurement."""
    by_name = {p["name"]: p for p in result["points"]}
    paper = by_name[result["presets"]["paper"]]
    chosen = eight_bit_setting(result)
    sentences = [
        f"For pictures and for training use `paper`: its RMS error is {levels(paper['error']['rms'])}, its error "
        f"at the worst pixel {levels(paper['error']['max'])}{_against_noise(paper, result)}."
    ]
    if chosen is not None:
        raster = chosen["setting"]["raster"]
        sentences.append(
            f"For an image of this scene that is off by at most one level of 8 bits, lower the cutoff to "
            f"{small(raster['alpha_cutoff'])} "
            f"and the stop to {small(raster['transmittance_stop'])}, in float32: "
            f"{chosen['visits'] / paper['visits']:.1f} times the visits of `paper`, and a largest error of "
            f"{levels(chosen['error']['max'])}. The table of the [other scenes](#on-trained-real-scenes) says where "
            "this does not suffice."
        )
    if result["joint"]:
        sentences.append(
            f"For a largest error below {levels(float32_floor(result))} use float64. Without a stop its error is here "
            f"at most {error_over_cutoff(result):.1f} times the cutoff. `exact` serves as the reference and is too "
            "slow for other work."
        )
    return sentences


def eight_bit_setting(result: dict[str, Any]) -> dict[str, Any] | None:
    """The cheapest float32 setting of the sweep whose largest error is at most half a step of 8 bit.

    Less than a whole step is off by at most one level: the half leaves a factor of two to other scenes and views.
    """
    kept = [p for p in _joint(result, "float32") if p["error"]["max"] <= result["lines"]["eight_bit"]]
    return min(kept, key=lambda p: (p["visits"], p["error"]["max"]), default=None)


def error_over_cutoff(result: dict[str, Any]) -> float:
    """Largest error over the cutoff in float64 without a stop, over the measured values of the cutoff alone.

    With a stop the smaller cutoffs would be charged with the error of the stop.
    """
    names = {name for dial in result["dials"] if dial["name"] == "cutoff" for name in dial["points"].values()}
    points = [point for point in result["points"] if point["name"] in names]
    return max((p["error"]["max"] / p["setting"]["raster"]["alpha_cutoff"] for p in points), default=float("nan"))


def float32_floor(result: dict[str, Any]) -> float:
    """The smallest largest error of all measured settings in float32."""
    errors = (p["error"]["max"] for p in result["points"] if p["setting"]["precision"] == "float32")
    return min(errors, default=float("nan"))


DIAL_COLUMNS = ("Dial", "Value", "frame", "with reverse", "work", "largest error", "worst gradient block")


def dial_rows(result: dict[str, Any]) -> list[list[str]]:
    """Every value of every dial, from accurate to fast: times, visited pairs or basis terms, errors."""
    by_name, rows = {p["name"]: p for p in result["points"]}, []
    for dial in result["dials"]:
        for label, name in dial["points"].items():
            point = by_name[name]
            work = f"{point[dial['cost']]:,} {dial['cost']}".replace(",", " ")
            times = [milliseconds(point[part]["median"]) for part in ("forward", "both")]
            errors = [levels(point["error"]["max"]), f"{point['error']['gradient']:.2g}"]
            rows.append([dial["title"], label, *times, work, *errors])
    return rows


def _against_noise(point: dict[str, Any], result: dict[str, Any]) -> str:
    noise = result["lines"]["sensor_noise"]
    if noise is None:
        return ""
    words = "below" if point["error"]["rms"] < noise else "above"
    return f"; the RMS is {words} the sensor noise of {levels(noise)}"


def _joint(result: dict[str, Any], precision: str) -> list[dict[str, Any]]:
    names = set(result["joint"])
    return [p for p in result["points"] if p["name"] in names and p["setting"]["precision"] == precision]


def dominated_by(point: Ranked, points: Sequence[Ranked]) -> list[str]:
    """Names of the points that dominate this one, cheapest first."""
    return [p.name for p in sorted(points, key=lambda p: (p.cost, p.errors)) if dominates(p, point)]


def judge_presets(points: Sequence[dict[str, Any]], presets: dict[str, str]) -> dict[str, dict[str, Any]]:
    """For every preset: the settings that dominate it, and the reason to keep it.

    A preset serves rendering and training, so another setting dominates it only if it visits no more pairs and is no
    worse in the largest error, the RMS error and every gradient block. The comparison is within one precision, where a
    visit costs the same arithmetic.

    points    entries of `tradeoff.json`
    presets   name -> name of its point
    """
    by_name = {p["name"]: p for p in points}
    found = {}
    for preset, name in presets.items():
        own = by_name[name]
        precision, terms = own["setting"]["precision"], own["terms"]
        peers = [_ranked(p) for p in points if p["setting"]["precision"] == precision and p["terms"] == terms]
        better = dominated_by(_ranked(own), peers)
        found[preset] = {"dominated_by": better, "reason": KEPT.get(preset) if better else None}
    return found


def _ranked(point: dict[str, Any]) -> Ranked:
    error = point["error"]
    return Ranked(point["name"], point["visits"], (error["max"], error["rms"], *error["gradients"].values()))


def summary(result: dict[str, Any]) -> list[str]:
    """The variation due to rounding, and the trainings that a faster one exceeds by more than this variation."""
    ends = {c["name"]: (c["seconds"], c["milestones"][-1]["psnr_full"]) for c in result["configurations"]}
    if "base" not in ends or None in [psnr for _, psnr in ends.values()]:
        return []
    chance, lines = 0.0, []
    if "float64" in ends:
        chance = abs(ends["float64"][1] - ends["base"][1])
        lines.append(
            "Noise: each run has one seed and was timed once. `float64` differs from `base` only by rounding and ends "
            f"{chance:.2f} dB from it. Read nothing into smaller differences."
        )
    for name, (seconds, psnr) in ends.items():
        better = [other for other, (time, best) in ends.items() if time < seconds and best > psnr + chance]
        if better:
            lines.append(
                f"*{name}* took longer than the following, and is worse by more than this difference: "
                f"{', '.join(better)}."
            )
    return lines


def training_rows(result: dict[str, Any]) -> list[list[str]]:
    """Name, PSNR, gain on the base, SSIM, LPIPS, time, time relative to the base, Gaussians."""
    by_name = {c["name"]: c for c in result["configurations"]}
    if "base" not in by_name:
        return []
    base = by_name["base"]["milestones"][-1]
    rows = []
    for c in result["configurations"]:
        last = c["milestones"][-1]
        cells = [
            f"{last['psnr_full']:.2f}",
            f"{last['psnr_full'] - base['psnr_full']:+.2f}",
            f"{last['ssim_full']:.4f}",
        ]
        cells.append("-" if last["lpips"] is None else f"{last['lpips']:.4f}")
        cells += [duration(last["seconds"]), f"{last['seconds'] / base['seconds']:.2f}x", str(last["gaussians"])]
        rows.append([c["name"], *cells])
    return rows
