"""Generated parts of docs/tradeoff.md as Markdown, from the JSON of `endotsr tradeoff` and `tradeoff_train.py`."""

from typing import Any, cast

from endotsr.results.report.tables import markdown
from endotsr.studies.tradeoff.results import DatedMeasurement
from endotsr.studies.tradeoff.text import COLUMNS, LEVELS, front_rows, levels, made
from pages.tradeoff.dials import OMITTED
from pages.tradeoff.text import (
    DIAL_COLUMNS,
    advice,
    dial_rows,
    eight_bit_setting,
    error_over_cutoff,
    float32_floor,
    judge_presets,
    summary,
    training_rows,
)

TRAINING_COLUMNS = ("Training", "PSNR full, dB", "to base", "SSIM", "LPIPS", "time", "to base", "Gaussians")


def fragments(
    result: dict[str, Any], others: dict[str, dict[str, Any]], trainings: dict[str, dict[str, Any]]
) -> dict[str, str]:
    """Every generated part by name; a missing measurement is marked.

    result      tradeoff.json of the simulated scene
    others      the same of trained real scenes, by name
    trainings   training.json by name
    """
    omitted = result["omitted"] | OMITTED  # reasons are facts of the present program, not of the measurement
    return {
        "promise": promise(result, others),
        "advice": _numbered(advice(result)),
        "made": made(cast(DatedMeasurement, result)),
        "front": markdown(COLUMNS, front_rows(cast(DatedMeasurement, result))),
        "dials": markdown(DIAL_COLUMNS, dial_rows(result)),
        "presets": _bullets(preset_lines(result)),
        "certificate": certificate_line(result),
        "omitted": _bullets([f"{what}: {why}." for what, why in omitted.items()]),
        "scenes": scenes(result, others),
        "training": "\n\n".join(training(name, t) for name, t in trainings.items()) or "Not measured yet.",
    }


def promise(result: dict[str, Any], others: dict[str, dict[str, Any]]) -> str:
    """The cost of a smaller error in one sentence, and the setting that is within one level of 8 bits on every scene.

    The costs are visited pairs, which are counted exactly. A time is stated only if it differs by more than settings
    with equal visits do in the same record.
    """
    by_name, chosen = {p["name"]: p for p in result["points"]}, eight_bit_setting(result)
    if chosen is None:
        return "No setting of float32 is within one level of 8 bits."
    paper, exact = (by_name[result["presets"][name]] for name in ("paper", "exact"))
    smaller = paper["error"]["max"] / chosen["error"]["max"]
    return (
        f"**On the simulated scene, *{chosen['name']}* makes the largest error {smaller:.0f} times smaller than "
        f"`paper` does, for {chosen['visits'] / paper['visits']:.1f} times the visited pairs. The exact picture visits "
        f"{exact['visits'] / paper['visits']:.0f} times the pairs of `paper`.** {time_sentence(result, chosen, paper)}"
        f"{_everywhere(result, others)}"
    )


def time_sentence(result: dict[str, Any], point: dict[str, Any], paper: dict[str, Any]) -> str:
    """The time of a frame of exactly this setting against exactly `paper`, if it exceeds the scatter of the record."""
    more, scatter = point["forward"]["median"] / paper["forward"]["median"] - 1, scatter_of_equal(result)
    if abs(more) <= scatter:
        return (
            f"The time of a frame with *{point['name']}* is not distinguished from that with `paper`: settings with "
            f"equal visits differ by up to {100 * scatter:.0f} % in this record."
        )
    return (
        f"A frame with *{point['name']}* takes {100 * more:+.0f} % time; settings with equal visits differ by up to "
        f"{100 * scatter:.0f} %."
    )


def scatter_of_equal(result: dict[str, Any]) -> float:
    """The largest relative difference of median times between settings of one precision with equal visits."""
    groups: dict[tuple[str, int], list[float]] = {}
    for point in result["points"]:
        if point["name"] in {*result["joint"], *result["presets"].values()} and point["setting"]["threads"] is None:
            key = (point["setting"]["precision"], point["visits"])
            groups.setdefault(key, []).append(point["forward"]["median"])
    return max((max(times) / min(times) - 1 for times in groups.values()), default=0.0)


def _everywhere(result: dict[str, Any], others: dict[str, dict[str, Any]]) -> str:
    """The float32 setting with the fewest visits whose error is at most half a step of 8 bits on every scene."""
    every = {"simulated": result} | others
    found: dict[str, list[float]] = {}  # setting -> visits relative to `paper`, by scene
    for scene in every.values():
        by_name = {p["name"]: p for p in scene["points"]}
        paper = by_name[scene["presets"]["paper"]]
        for point in (by_name[name] for name in scene["joint"]):
            if point["setting"]["precision"] == "float32" and point["error"]["max"] <= scene["lines"]["eight_bit"]:
                found.setdefault(point["name"], []).append(point["visits"] / paper["visits"])
    kept = {name: ratios for name, ratios in found.items() if len(ratios) == len(every)}
    if len(every) < 2 or not kept:
        return ""
    best = min(kept, key=lambda name: (sum(kept[name]), name))
    listed = ", ".join(f"{ratio:.1f} ({scene})" for scene, ratio in zip(every, kept[best], strict=True))
    return (
        f" The setting *{best}*, without the Jacobian clamp of the presets, is off by at most one level of 8 bits in"
        f" the measured view of each of the {len(every)} scenes of this page. Its visited pairs, as multiples of those"
        f" of `paper`: {listed}."
    )


def preset_lines(result: dict[str, Any]) -> list[str]:
    """Status of each preset: on the front, or dominated by other settings and kept for a reason."""
    lines = []
    for name, verdict in judge_presets(result["points"], result["presets"]).items():
        better, reason = verdict["dominated_by"], verdict["reason"]
        if not better:
            lines.append(f"`{name}`: not dominated.")
        else:
            stays = f" It is kept because it {reason}." if reason else " No reason to keep it is listed."
            lines.append(f"`{name}`: dominated by {better[0]}{_more(len(better) - 1)}.{stays}")
    return lines


def _more(count: int) -> str:
    return f" and {count} more" if count else ""


def certificate_line(result: dict[str, Any]) -> str:
    """The figures of the certificate."""
    c = result["reference"]["certificate"]
    return (
        f"Reference: differs from a cutoff of 1e-14 by {c['exact_against_1e14']:.1e}, from mpmath (30 digits) at "
        f"{c['pixels']} pixels by {c['pixels_against_mpmath']:.1e}; cutoffs 1e-12 and 1e-14 differ by "
        f"{c['cut_1e12_against_1e14']:.1e}. {'The certificate holds.' if c['holds'] else 'THE CERTIFICATE FAILS.'}"
    )


def scenes(result: dict[str, Any], others: dict[str, dict[str, Any]]) -> str:
    """The advice of the simulated scene, checked on every other."""
    columns = (
        "Scene",
        "Gaussians",
        "`paper`: RMS",
        "`paper`: largest",
        "error over cutoff without a stop, at most",
        "smallest error of float32",
        "8-bit setting: largest",
        "its visits",
        "verdict",
    )
    rows = [_scene_row(result, result), *(_scene_row(other, result) for other in others.values())]
    about = [
        f"`{name}`: {made(cast(DatedMeasurement, other))} {certificate_line(other)}" for name, other in others.items()
    ]
    return "\n\n".join([markdown(columns, rows), _bullets(about)]) if others else "Not measured yet."


def _scene_row(scene: dict[str, Any], simulated: dict[str, Any]) -> list[str]:
    by_name = {p["name"]: p for p in scene["points"]}
    paper = by_name[scene["presets"]["paper"]]
    advised = eight_bit_setting(simulated)
    here = by_name.get(advised["name"]) if advised else None
    row = [scene["scene"]["name"], str(scene["scene"]["gaussians"]), levels(paper["error"]["rms"])]
    row += [levels(paper["error"]["max"]), f"{error_over_cutoff(scene):.1f}", levels(float32_floor(scene))]
    if here is None:
        return [*row, "-", "-", "no such setting"]
    ratio = f"{here['visits'] / paper['visits']:.1f}x"
    return [*row, levels(here["error"]["max"]), ratio, verdict(scene, paper, here, simulated["lines"]["sensor_noise"])]


def verdict(scene: dict[str, Any], paper: dict[str, Any], here: dict[str, Any], noise: float) -> str:
    """Whether the first two sentences of advice are right on a scene, and otherwise the alternative.

    noise   of the sensor of the simulated scene, which the first sentence names

    Each is held against what it promises. Two pictures that differ by less than one step are off by at most one level
    after rounding. Errors of equal renderings are equal to the bit: they have no scatter to allow for.
    """
    wrong = []
    if paper["error"]["rms"] >= noise:
        wrong.append("the RMS error of `paper` is not below the sensor noise")
    if here["error"]["max"] >= 1 / LEVELS:
        better = eight_bit_setting(scene)
        instead = f"take {better['name']}" if better else "no float32 setting of the sweep keeps it"
        wrong.append(f"the 8-bit setting is off by more than one level: {instead}")
    return "holds" if not wrong else "does not hold: " + "; ".join(wrong)


def training(name: str, result: dict[str, Any]) -> str:
    """One study of training: its conditions, its picture, the table, and the dominated trainings."""
    m = result["machine"]
    head = (
        f"**{result['sequence']}**, {result['frames']} frames of {result['width']}x{result['height']}, preset "
        f"`{result['preset']}` with its schedule scaled to {result['iterations']} iterations, measured "
        f"{result['date'][:10]} on {result['threads']} threads of {m['processor']} ({m['cores']} cores)."
    )
    left = [f"{name}: {reason}" for name, reason in result["left_out"].items()]
    picture = f"![Held-out PSNR against minutes of training](results/tradeoff_training_{name}.svg)"
    table = markdown(TRAINING_COLUMNS, training_rows(result))
    return "\n\n".join(part for part in (head, picture, table, _bullets(summary(result)), _bullets(left)) if part)


def _numbered(sentences: list[str]) -> str:
    return "\n".join(f"{i}. {sentence}" for i, sentence in enumerate(sentences, 1))


def _bullets(lines: list[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)
