"""The results in `training.json` as text: a table of the trainings, and the gain of each interval of time."""

from typing import Any

from endotsr.report.tables import plain
from endotsr.report.words import duration


def training_lines(result: dict[str, Any]) -> list[str]:
    """Text for the terminal: the final state of every training beside the base, then the gain of each interval."""
    rows = training_rows(result)
    lines = [plain(("training", "PSNR", "to base", "SSIM", "LPIPS", "time", "to base", "Gaussians"), rows)]
    lines += [f"left out: {name} ({reason})" for name, reason in result["left_out"].items()]
    return lines + summary(result) + gain_by_minute(best_by_time(result))


def summary(result: dict[str, Any]) -> list[str]:
    """The variation by rounding alone, and the trainings that a faster one exceeded by more than that variation."""
    ends = {c["name"]: (c["seconds"], c["milestones"][-1]["psnr_full"]) for c in result["configurations"]}
    if "base" not in ends or None in [psnr for _, psnr in ends.values()]:
        return []
    chance, lines = 0.0, []
    if "float64" in ends:
        chance = abs(ends["float64"][1] - ends["base"][1])
        lines.append(
            f"one seed each: `float64` differs from `base` by rounding alone and ends {chance:.2f} dB from it, "
            "so that is how far chance goes here"
        )
    beaten = {
        name: [other for other, (time, best) in ends.items() if time < seconds and best > psnr + chance]
        for name, (seconds, psnr) in ends.items()
    }
    kept = [name for name in sorted(ends, key=lambda n: ends[n]) if not beaten[name]]
    lines.append(f"nothing was both faster and better by more than chance than: {', '.join(kept)}")
    lines += [f"{name}: beaten by {', '.join(others)}" for name, others in beaten.items() if others]
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


def best_by_time(result: dict[str, Any]) -> list[dict[str, Any]]:
    """The measured states that no other state reached sooner and better, earliest first."""
    rows = [
        row | {"name": c["name"], "change": c["change"]}
        for c in result["configurations"]
        for row in c["milestones"]
        if row["psnr_full"] is not None
    ]
    found: list[dict[str, Any]] = []
    for row in sorted(rows, key=lambda r: (r["seconds"], -r["psnr_full"])):
        if not found or row["psnr_full"] > found[-1]["psnr_full"]:
            found.append(row)
    return found


def gain_by_minute(states: list[dict[str, Any]], least: float = 0.3, stretch: float = 1.5) -> list[str]:
    """The best states: time, training, and gain per minute since the state before.

    least, stretch   a state is listed if it is `least` dB better and `stretch` times later than the last listed one
    """
    lines: list[str] = []
    before: dict[str, Any] | None = None
    for row in states:
        if before is not None and row is not states[-1]:
            if row["psnr_full"] < before["psnr_full"] + least or row["seconds"] < stretch * before["seconds"]:
                continue
        line = (
            f"after {duration(row['seconds'])}: {row['psnr_full']:.2f} dB ({row['name']}, iteration {row['iteration']})"
        )
        if before is not None:
            minutes = (row["seconds"] - before["seconds"]) / 60
            line += f", {(row['psnr_full'] - before['psnr_full']) / max(minutes, 1e-9):.2f} dB a minute"
        lines.append(line)
        before = row
    return lines
