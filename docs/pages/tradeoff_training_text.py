"""The results in `training.json` as text: a table of the trainings, and which of them another one exceeds."""

from typing import Any

from endotsr.report.tables import plain
from endotsr.report.words import duration


def training_lines(result: dict[str, Any]) -> list[str]:
    """Text for the terminal: the final state of every training beside the base, and the summary."""
    rows = training_rows(result)
    lines = [plain(("training", "PSNR", "to base", "SSIM", "LPIPS", "time", "to base", "Gaussians"), rows)]
    lines += [f"left out: {name} ({reason})" for name, reason in result["left_out"].items()]
    return lines + summary(result)


def summary(result: dict[str, Any]) -> list[str]:
    """The variation by rounding alone, and the trainings that a faster one exceeded by more than that variation."""
    ends = {c["name"]: (c["seconds"], c["milestones"][-1]["psnr_full"]) for c in result["configurations"]}
    if "base" not in ends or None in [psnr for _, psnr in ends.values()]:
        return []
    chance, lines = 0.0, []
    if "float64" in ends:
        chance = abs(ends["float64"][1] - ends["base"][1])
        lines.append(
            "Noise: each training has one seed. `float64` differs from `base` only by rounding and ends "
            f"{chance:.2f} dB from it. Smaller differences are noise."
        )
    for name, (seconds, psnr) in ends.items():
        better = [other for other, (time, best) in ends.items() if time < seconds and best > psnr + chance]
        if better:
            lines.append(f"*{name}* is slower than the following, and worse beyond noise: {', '.join(better)}.")
    return lines


def training_rows(result: dict[str, Any]) -> list[list[str]]:
    """Name, PSNR, gain on the base, SSIM, LPIPS, time, time over that of the base, Gaussians."""
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
