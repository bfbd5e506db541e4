"""The table and the picture of docs/bench.md on what a training says about its time."""

from pathlib import Path
from typing import Any

from endotsr.results.report.style import BLUE, GREEN, GREY, INK, ORANGE, name_axes, new_figure, plain_axes, save
from endotsr.results.report.tables import duration, markdown

PICTURE = Path(__file__).parents[2] / "results" / "waiting.svg"
COLOURS = (BLUE, GREEN, ORANGE, INK)
CLOCKS = {"processor": "processor time of one thread", "wall": "time on the wall"}


def told(row: dict[str, Any], when: str) -> str:
    """The time left that was said, the time that was left, and the relative error."""
    said = row["said"].get(when)
    if said is None:
        return "-"
    left = row["whole"] - said["at"]
    return f"{duration(said['left'])} of {duration(left)} ({said['left'] / left - 1:+.0%})"


def named(row: dict[str, Any]) -> str:
    """Clip, preset and seed."""
    return f"{row['clip']}, `{row['preset']}`, {row['iterations']} iterations, seed {row['seed']}"


def table(rows: list[dict[str, Any]]) -> str:
    """One row per command."""
    heads = ["Training", "Frames", "First line: said, left", "After 30 iterations", "After a minute",
             "Largest rise", "Evaluation", "Whole command"]  # fmt: skip
    cells = []
    for row in rows:
        first = told(row, "start") + (", speed assumed" if row["said"]["start"]["speed"] == "assumed" else "")
        after = row["whole"] - row["trained"]
        cells.append(
            [named(row), str(row["frames"]), first, told(row, "forecast"), told(row, "minute"),
             f"{row['largest_rise']:.0%}", duration(after), duration(row["whole"])]
        )  # fmt: skip
    return markdown(heads, cells)


def about(rows: list[dict[str, Any]]) -> str:
    """Sizes, clocks, machines and the last day."""
    sizes, clocks = sorted({row["size"] for row in rows}), sorted({CLOCKS[row["clock"]] for row in rows})
    machines = sorted({row["machine"]["processor"] for row in rows})
    return (
        f"Frames of {' and '.join(sizes)}, every eighth held out; {' and '.join(clocks)}; {', '.join(machines)}; "
        f"{max(row['date'] for row in rows)}. The largest rise is that of the time left over its smallest value before."
    )


def qualities(rows: list[dict[str, Any]]) -> str:
    """Held-out means of every training beside the blend of its clip."""
    heads = ["Training", "PSNR full, dB", "PSNR tissue, dB", "LPIPS", "Blend: PSNR full, dB", "Blend: LPIPS"]
    cells = []
    for row in rows:
        ours, blend = row["held_out"], row["blend"]
        numbers = (ours["psnr_full"], 2), (ours["psnr_tissue"], 2), (ours["lpips"], 4), (blend["psnr_full"], 2)
        numbers = (*numbers, (blend["lpips"], 4))
        cells.append([named(row), *("-" if n is None else f"{n:.{digits}f}" for n, digits in numbers)])
    return markdown(heads, cells)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Held-out PSNR against seconds of training, a panel for each clip, with the level of the blend."""
    clips = list(dict.fromkeys(row["clip"] for row in rows))
    figure = new_figure(3.7 * len(clips), 3.2)
    for axes, clip in zip(figure.subplots(1, len(clips), squeeze=False)[0], clips, strict=True):
        shown = [row for row in rows if row["clip"] == clip]
        for row, colour in zip(shown, COLOURS * len(shown)):
            start = row["said"]["start"]["at"] + row["said"]["start"]["initial"]
            points = [(point["seconds"] - start, point["psnr_full"]) for point in row["curve"]]
            axes.plot(*zip(*points, strict=True), "o-", color=colour, markersize=3)
            label = f"{row['preset']}, {row['iterations']}"
            axes.annotate(label, points[-1], xytext=(-4, -12), textcoords="offset points", ha="right", fontsize=8)
        level = shown[0]["blend"]["psnr_full"]
        axes.axhline(level, color=GREY, linewidth=1, linestyle="--")
        axes.annotate("blend", (1.0, level), xycoords=("axes fraction", "data"), xytext=(-4, 2),
                      textcoords="offset points", ha="right", fontsize=8, color=GREY)  # fmt: skip
        axes.set_title(clip, fontsize=9)
        name_axes(axes, "seconds of training", "held-out PSNR, dB")
        plain_axes(axes)
    save(figure, path)


def parts(result: dict[str, Any]) -> dict[str, str]:
    """The generated parts of the page."""
    rows = result["rows"]
    picture = f"![Held-out PSNR against seconds of training](results/{PICTURE.name})"
    return {"said": f"{table(rows)}\n\n{about(rows)}", "quality": f"{picture}\n\n{qualities(rows)}"}
