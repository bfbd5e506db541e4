"""Tabulate and draw the minutes and the memory of a training against the number of frames, for every preset.

Nothing is trained. The numbers are the estimates printed by `endotsr check` and at the start of a training
(`clips/sequences/forecast/cost.py`), with the timed trainings of docs/results/minutes.json for comparison.
"""

from endotsr.clips.sequences.forecast.cost import Cost, estimated_cost
from endotsr.clips.sequences.forecast.seconds import expected_frames
from endotsr.clips.sequences.splits import every_eighth
from endotsr.config import PRESETS, lengthened, with_settings
from endotsr.results.report.style import BLUE, GREEN, ORANGE, legend, name_axes, new_figure, plain_axes, save
from endotsr.results.report.tables import markdown
from pages.store import figures
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program

PICTURE = RESULTS / "scale.svg"


FRAMES = (16, 32, 63, 160, 256, 512)
SIZES = ((320, 256), (640, 512), (1280, 1024))
MEMORY = 8.0  # GB for a training; frames and targets beyond a fraction of it are kept in files
COLOURS = {"quick": GREEN, "paper": BLUE, "sharp": ORANGE}  # by preset


def estimated(preset: str, frames: int, width: int, height: int) -> tuple[int, Cost]:
    """Iterations of a run with a preset, and its cost."""
    config = lengthened(PRESETS[preset], len(every_eighth(frames)[0]))
    config = with_settings(config, sequence={"memory": MEMORY})
    return config.training.iterations, estimated_cost(expected_frames(frames, config), width, height, config)


def table() -> str:
    """Minutes and memory by frames and size, a pair of columns for each preset."""
    heads = [f"`{name}`: {what}" for name in COLOURS for what in ("minutes", "GB")]
    rows = []
    for width, height in SIZES:
        for frames in FRAMES:
            costs = [estimated(name, frames, width, height)[1] for name in COLOURS]
            cells = [text for c in costs for text in (f"{c.minutes:.1f}", f"{c.total_bytes / 1e9:.1f}")]
            rows.append([f"{width}x{height}", str(frames), *cells])
    return markdown(["Size", "Frames", *heads], rows)


def measured() -> str:
    """The timed trainings of docs/results/minutes.json with their estimates, a sentence each."""
    lines, rows = [], loaded(RESULTS / "minutes.json")["rows"]
    for preset in COLOURS:
        run, (iterations, cost) = rows[preset][-1], estimated(preset, 63, 640, 512)
        lines.append(
            f"- `{preset}`, 63 frames of 640x512, {iterations} iterations: estimated {cost.minutes:.1f} minutes, "
            f"{cost.gaussians} Gaussians and {cost.total_bytes / 1e9:.1f} GB; measured {run['seconds'] / 60:.1f} "
            f"minutes, {run['gaussians']} Gaussians and {run['peak_memory_bytes'] / 1e9:.1f} GB on {run['processor']}."
        )
    return "\n".join(lines)


def draw(record: None) -> None:
    """Minutes and memory at 640x512 against the number of frames, a panel each."""
    figure = new_figure(7.0, 2.9)
    panels = figure.subplots(1, 2)
    for preset, colour in COLOURS.items():
        costs = [estimated(preset, frames, 640, 512)[1] for frames in FRAMES]
        for axes, values in zip(
            panels, ([c.minutes for c in costs], [c.total_bytes / 1e9 for c in costs]), strict=True
        ):
            axes.plot(FRAMES, values, "o-", color=colour, markersize=3, label=preset)
    for axes, name in zip(panels, ("minutes", "memory, GB"), strict=True):
        figures.logarithmic_x(axes, FRAMES, ylim=(0, None))
        name_axes(axes, "frames of 640x512", name)
        plain_axes(axes)
    legend(panels[0])
    save(figure, PICTURE)


def minutes() -> str:
    """Picture, table and the timed trainings."""
    picture = f"![Minutes and memory of a training run against its number of frames](results/{PICTURE.name})"
    return "\n\n".join((picture, table(), measured()))


PROGRAM = Program(__name__, "bench.md", {"minutes": minutes}, draw=draw)
