"""Three pieces of advice, each with the figures of a measurement of `endotsr tradeoff`."""

from typing import Any

from endotsr.tradeoff.text import levels


def small(number: float) -> str:
    """A cutoff or a stop: 1/255, 1/1024, 1e-4."""
    return f"1/{round(1 / number)}" if number > 5e-4 else f"{number:.0e}".replace("e-0", "e-")


def advice(result: dict[str, Any]) -> list[str]:
    """Three pieces, each with the figures of this measurement."""
    by_name = {p["name"]: p for p in result["points"]}
    paper = by_name[result["presets"]["paper"]]
    chosen = eight_bit_setting(result)
    sentences = [
        f"For pictures and for training use `paper`: its error is {levels(paper['error']['rms'])} on average and "
        f"{levels(paper['error']['max'])} at the worst pixel{_against_noise(paper, result)}."
    ]
    if chosen is not None:
        raster = chosen["setting"]["raster"]
        sentences.append(
            f"For an image that is right to the last of 8 bits, lower the cutoff to {small(raster['alpha_cutoff'])} "
            f"and the stop to {small(raster['transmittance_stop'])}, in float32: "
            f"{chosen['visits'] / paper['visits']:.1f} times the visits of `paper`, and a largest error of "
            f"{levels(chosen['error']['max'])}."
        )
    if result["joint"]:
        sentences.append(
            f"For a largest error below {levels(float32_floor(result))} use float64. Its error is here at most "
            f"{error_over_cutoff(result):.1f} times the cutoff. `exact` serves as the reference and is too slow for "
            "other work."
        )
    return sentences


def eight_bit_setting(result: dict[str, Any]) -> dict[str, Any] | None:
    """The cheapest float32 setting of the sweep whose largest error is below half a step of 8 bit."""
    kept = [p for p in _joint(result, "float32") if p["error"]["max"] <= result["lines"]["eight_bit"]]
    return min(kept, key=lambda p: (p["visits"], p["error"]["max"]), default=None)


def error_over_cutoff(result: dict[str, Any]) -> float:
    """Largest error over the cutoff, in float64, where the cutoff decides: at the tightest stop, below it."""
    rasters = [(p["error"]["max"], p["setting"]["raster"]) for p in _joint(result, "float64")]
    ratios = [
        error / raster["alpha_cutoff"]
        for error, raster in rasters
        if raster["transmittance_stop"] <= 1e-6 and raster["alpha_cutoff"] > raster["transmittance_stop"]
    ]
    return max(ratios, default=float("nan"))


def float32_floor(result: dict[str, Any]) -> float:
    """The smallest largest error of the sweep in float32."""
    return min((p["error"]["max"] for p in _joint(result, "float32")), default=float("nan"))


def _against_noise(point: dict[str, Any], result: dict[str, Any]) -> str:
    noise = result["lines"]["sensor_noise"]
    if noise is None:
        return ""
    words = "below" if point["error"]["rms"] < noise else "above"
    return f", its average {words} the sensor noise of {levels(noise)}"


def _joint(result: dict[str, Any], precision: str) -> list[dict[str, Any]]:
    names = set(result["joint"])
    return [p for p in result["points"] if p["name"] in names and p["setting"]["precision"] == precision]
