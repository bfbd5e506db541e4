"""The tables and pictures of docs/bench.md on what a training says about its time."""

from typing import Any

from endotsr.results.report.style import BLUE, GREEN, INK, ORANGE, legend, name_axes, new_figure, plain_axes, save
from endotsr.results.report.tables import duration, markdown
from pages.store import figures
from pages.store.program import RESULTS
from pages.store.tables import noted, numbers

PICTURE, COURSE = RESULTS / "waiting.svg", RESULTS / "time_left.svg"
BAND = 0.15  # of the time left, within which a forecast is asked to be
SHOWN = 0.95  # of the training; at its end a second is a large part of the time left
QUALITY = (("psnr_full", 2), ("psnr_tissue", 2), ("lpips", 4))
COLOURS = (BLUE, GREEN, ORANGE, INK)
CLOCKS = {"processor": "processor time of one thread", "wall": "two threads on the clock"}
FORMERLY = 30  # iterations before the forecast of rows that do not state it
VECTORS = {64: "AVX-512", 32: "AVX2", 0: ""}  # by the bytes of a register; 0: not recorded


def told(row: dict[str, Any], when: str) -> str:
    """The time left that was said, the time that was left, and the relative error."""
    said = row["said"].get(when)
    if said is None:
        return "-"
    left = row["whole"] - said["at"]
    return f"{duration(said['left'])} of {duration(left)} ({said['left'] / left - 1:+.0%})"


def named(row: dict[str, Any]) -> str:
    """Clip, preset, seed, processor and clock, and whether the kernels were compiled first."""
    about = [row["clip"], f"`{row['preset']}`", f"{row['iterations']} iterations", f"seed {row['seed']}"]
    about += [processor(row), CLOCKS["wall"]] if row["clock"] == "wall" else []
    return ", ".join(filter(None, (*about, "with compilation" * row["cold"])))


def processor(row: dict[str, Any]) -> str:
    """The processor of a row without marks of trade, with its vectors where they were recorded."""
    name = row["processor"].replace("(R)", "").removesuffix(" Processor")
    vectors = VECTORS[row["register_bytes"]]
    return f"{name} with {vectors}" if vectors else name


def said(result: dict[str, Any]) -> str:
    """One row per command, and the picture of the time left."""
    rows = result["rows"]
    heads = ["Training", "Frames", "First line: said, left", "Forecast", "After a minute",
             "Largest rise", "Evaluation", "Whole command"]  # fmt: skip
    cells = []
    for row in rows:
        speed = row["said"]["start"]["speed"]
        first = told(row, "start") + (f", speed {speed}" if speed != "measured" else "")
        evaluation = duration(row["whole"] - row["trained"]) + " (former)" * ("blas_threads" not in row)
        cells.append(
            [named(row), str(row["frames"]), first, told(row, "forecast"), told(row, "minute"),
             f"{row['largest_rise']:.0%}", evaluation, duration(row["whole"])]
        )  # fmt: skip
    picture = f"![Error of the time left against the elapsed fraction of the training](results/{COURSE.name})"
    return f"{noted(heads, cells, about(rows))}\n\n{picture}"


def about(rows: list[dict[str, Any]]) -> str:
    """Sizes, clocks, machines and the last day."""
    sizes, clocks = sorted({row["size"] for row in rows}), sorted({CLOCKS[row["clock"]] for row in rows})
    machines = sorted({row["processor"] for row in rows})
    after = " or ".join(map(str, sorted({row.get("forecast_after", FORMERLY) for row in rows})))
    former = (
        " A *former* evaluation is of a command before the evaluation and the initial motion were changed."
    ) * any("blas_threads" not in row for row in rows)
    speeds = {row["said"]["start"]["speed"] for row in rows}
    if "assumed" in speeds:
        former += (
            " A speed that was *assumed* was the same for every machine with vectors of this length; a few iterations"
            " are *timed* now."
        )
    return (
        f"Frames of {' and '.join(sizes)}, every eighth held out; {' and '.join(clocks)}; {', '.join(machines)}; "
        f"{max(row['date'] for row in rows)}. The forecast was printed after {after} iterations. The largest rise is "
        f"that of the time left over its smallest value before.{former}"
    )


def quality(result: dict[str, Any]) -> str:
    """The picture, and held-out means of every training beside the blend of its clip."""
    picture = f"![Held-out PSNR against seconds of training](results/{PICTURE.name})"
    heads = ["Training", "PSNR full, dB", "PSNR tissue, dB", "LPIPS", "Blend: PSNR full, dB", "Blend: LPIPS"]
    cells = [
        [named(row), *numbers(row["held_out"], QUALITY), *numbers(row["blend"], (QUALITY[0], QUALITY[2]))]
        for row in result["rows"]
    ]
    return f"{picture}\n\n{markdown(heads, cells)}"


def draw(result: dict[str, Any]) -> None:
    """Both pictures, of the rows with the course of the time left, a panel for each clip."""
    rows = [row for row in result["rows"] if row.get("course")]
    clips = list(dict.fromkeys(row["clip"] for row in rows))
    for picture, panel in ((PICTURE, _draw_quality), (COURSE, _draw_course)):
        figure = new_figure(3.7 * len(clips), 3.2)
        for axes, clip in zip(figure.subplots(1, len(clips), squeeze=False)[0], clips, strict=True):
            panel(axes, [row for row in rows if row["clip"] == clip])
            axes.set_title(clip, fontsize=9)
            plain_axes(axes)
        save(figure, picture)


def _draw_quality(axes: Any, rows: list[dict[str, Any]]) -> None:
    """Held-out PSNR against seconds of training, with the level of the blend."""
    for row, colour in zip(rows, COLOURS * len(rows)):
        start = row["said"]["start"]["at"] + row["said"]["start"]["initial"]
        points = [(point["seconds"] - start, point["psnr_full"]) for point in row["curve"]]
        label = f"{row['preset']}, {row['iterations']} iterations"
        axes.plot(*zip(*points, strict=True), "o-", color=colour, markersize=3, label=label)
    figures.level(axes, rows[0]["blend"]["psnr_full"], "blend")
    name_axes(axes, "seconds of training", "held-out PSNR, dB")
    legend(axes, loc="lower right")


def _draw_course(axes: Any, rows: list[dict[str, Any]]) -> None:
    """The time left that was shown over the one that was left, minus one, against the fraction of the training."""
    for row, colour in zip(rows, COLOURS * len(rows)):
        end, begin = row["trained"], row["said"]["start"]["at"]
        found = [((one["at"] - begin) / (end - begin), one["left"] / (end - one["at"]) - 1.0)
                 for one in row["course"] if one["at"] - begin < SHOWN * (end - begin)]  # fmt: skip
        axes.plot(*zip(*found, strict=True), "-", color=colour, label=row["preset"])
    axes.axhspan(-BAND, BAND, color=INK, alpha=0.08, linewidth=0)
    axes.set_ylim(-0.4, 0.4)
    name_axes(axes, "elapsed fraction of the training", "time left: shown over true - 1")
    legend(axes, loc="lower right")
