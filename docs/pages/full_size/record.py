"""Record a run: docs/results/NAME.json from RUN/metrics.json, and the tables made from all recorded runs.

    python docs/make.py full_size.record measure RUN NAME COMMIT   add or replace one record, then rewrite the tables

COMMIT is the revision of this repository that made the run. The first part of NAME is `pulling` or `cutting`. A record
with the same held-out metrics in every bit keeps its description of the run: it is the same model, with more rows.

The tables stand in docs/results/README.md; README.md has the one of every eighth frame of pulling. The tables of
cutting give in brackets the means without frames 73 and 74.
"""

import argparse
from pathlib import Path

import numpy as np

from endotsr.results.evaluation.evaluate import EVERY_BASELINE
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.untrusted.names import counted as counted_of
from pages.full_size.interpolation import LEFT_OUT, frames_text, tissue_only
from pages.store.commands import loaded
from pages.store.intervals import interval
from pages.store.program import RESULTS, RUN, Program
from pages.store.published import PUBLISHED, as_printed

EVERY_EIGHTH = "every eighth frame"
CLIPS = ("pulling", "cutting")
PLANNED = {
    "pulling": {"paper": 3, "quick": 3, "sharp": 3},
    "cutting": {"paper": 5, "quick": 3, "sharp": 3},
}  # seeds of a preset
MORE = (
    "[All runs, with blocks of frames held out, machine and times](docs/results/README.md). ± is a 95 % interval over "
    "the seeds."
)
RANGE = "The paper does not state the input range of its LPIPS, so the published value stands in both columns."
OF_RENDERS = {  # key of a prediction that is made of renders: its name, by preset
    "recorded_texture": "`{}` with recorded texture", "cross_fade": "blend of the own renders of `{}`",
}  # fmt: skip
COLUMNS = (
    ("psnr_full", "PSNR full, dB", "{:.2f}"),
    ("psnr_tissue", "PSNR tissue, dB", "{:.2f}"),
    ("ssim_full", "SSIM full", "{:.4f}"),
    ("lpips", "LPIPS [0,1]", "{:.4f}"),
    ("lpips_symmetric", "LPIPS [-1,1]", "{:.4f}"),
)


def record(options: argparse.Namespace) -> None:
    """Copy the metrics of a run; paths of the machine are reduced to the name of the folder."""
    metrics = loaded(options.run / "metrics.json")
    source = metrics["run"]["input"]
    source["source"] = Path(source["source"]).name
    metrics["run"]["commit"] = options.commit
    metrics["published"] = [row for clip, row in PUBLISHED.items() if clip in source["source"]]
    file = RESULTS / f"{options.name}.json"
    before = loaded(file) if file.is_file() else {}
    if before.get("held_out") == metrics["held_out"]:
        metrics["run"] = before["run"]
    write_json(file, metrics)


def split_of(metrics: dict) -> str:
    """The held-out frames of a run, in words."""
    sequence = metrics["run"]["settings"]["sequence"]
    frames = sequence["block_length"]
    words = {
        "every_eighth": EVERY_EIGHTH, "every_second": "every second frame",
        "blocks": f"blocks of {frames} frames", "end": f"the last {frames} frames",
    }  # fmt: skip
    return words[sequence["split"]]


def clip_of(metrics: dict) -> str:
    """The folder of the clip that a run read."""
    return metrics["run"]["input"]["source"]


def means(part: dict, without: tuple[int, ...]) -> dict[str, float | None]:
    """Means of the metrics over the held-out frames, some of them left out; None where one is not measured."""
    if not without:
        return part["mean"]
    frames = [row for row in part["per_frame"] if row["frame"] not in without]
    values = {key: [row[key] for row in frames if row.get(key) is not None] for key, _, _ in COLUMNS}
    return {key: float(np.mean(of)) if of else None for key, of in values.items()}


def rows(records: dict[str, dict], without: tuple[int, ...] = ()) -> list[tuple[str, list[dict]]]:
    """Label and held-out means: the seeds of every preset, the baselines of the first run, what was published.

    without   held-out frames that the means leave out
    """
    first = next(iter(records.values()))
    presets: dict[str, list[dict]] = {}
    own: dict[str, dict[str, list[dict]]] = {key: {} for key in OF_RENDERS}
    for metrics in records.values():
        preset = metrics["run"]["settings"]["preset"]
        presets.setdefault(preset, []).append(means(metrics["held_out"], without))
        for key, found in own.items():
            if row := metrics.get(key):
                found.setdefault(preset, []).append(means(row, without))
    out = [(f"endotsr, preset `{name}`{counted(runs)}", runs) for name, runs in presets.items()]
    for key, found in own.items():
        out += [(f"{OF_RENDERS[key].format(name)}{counted(of)}", of) for name, of in found.items()]
    out += [(baseline["label"], [means(baseline, without)]) for baseline in first["baselines"].values()]
    held_out = [row["frame"] for row in first["held_out"]["per_frame"]]
    kept = tissue_only(clip_of(first), split_of(first), without, held_out)  # records older than these lack them
    out += [(EVERY_BASELINE[name][0], [row]) for name, row in kept.items() if name not in first["baselines"]]
    published = first["published"] if split_of(first) == EVERY_EIGHTH else []
    both = [row | {"lpips_symmetric": row.get("lpips")} for row in published]  # the paper does not state the range
    return out + [(row["label"], [{} if without else row]) for row in both]


def missing(clip: str, records: dict[str, dict]) -> str:
    """A sentence about the seeds of every eighth frame that are not recorded; "" if none is missing."""
    runs = [metrics for metrics in records.values() if split_of(metrics) == EVERY_EIGHTH]
    found = [metrics["run"]["settings"]["preset"] for metrics in runs]
    lacking = [f"`{name}` {found.count(name)} of {count} seeds"
               for name, count in PLANNED[clip].items() if found.count(name) < count]  # fmt: skip
    more = "The seeds of the ablation are in [the claims](../claims.md)."
    return f"This table lacks runs on {clip}: {', '.join(lacking)}. {more}" if lacking else ""


def counted(runs: list[dict]) -> str:
    """The number of seeds that a mean is taken over."""
    return f", mean of {len(runs)} seeds" if len(runs) > 1 else ", one seed"


def cell(values: list[dict], key: str, form: str) -> str:
    """The mean over the seeds, with the half width of its 95 % interval (Student) if there are several."""
    numbers = [row[key] for row in values if row.get(key) is not None]
    if not numbers:
        return "-"
    if "label" in values[0]:  # a published row
        return as_printed(key, numbers[0])
    mean, half = interval(numbers)
    return form.format(mean) + (f" ± {form.format(half)}" if len(numbers) > 1 else "")


def table(records: dict[str, dict]) -> str:
    """For every split of one clip the held-out means as Markdown."""
    parts = []
    clip = clip_of(next(iter(records.values())))
    for split in dict.fromkeys(split_of(metrics) for metrics in records.values()):
        chosen = {name: metrics for name, metrics in records.items() if split_of(metrics) == split}
        held_out = next(iter(chosen.values()))["frames"]["held_out"]
        without = tuple(frame for frame in LEFT_OUT.get(clip, ()) if frame in held_out)
        bare = rows(chosen, without) if without else rows(chosen)
        cells = [
            [label, *(_both(values, other, key, form, bool(without)) for key, _, form in COLUMNS)]
            for (label, values), (_, other) in zip(rows(chosen), bare, strict=True)
        ]
        about = "Held out" if clip == "endonerf_pulling" else f"{clip}, held out"
        brackets = f" (in brackets without {frames_text(without)})" if without else ""
        parts.append(markdown([f"{about}: {split}{brackets}", *(c[1] for c in COLUMNS)], cells))
    return "\n\n".join(parts)


def _both(values: list[dict], other: list[dict], key: str, form: str, bracketed: bool) -> str:
    found, bare = cell(values, key, form), cell(other, key, form)
    return f"{found} ({bare})" if bracketed and bare != "-" else found


def about(name: str, metrics: dict) -> str:
    """What was run, when, on what."""
    run, training, machine = metrics["run"], metrics["training"]["mean"], metrics["run"]["machine"]
    source, settings = run["input"], run["settings"]
    return (
        f"- `{name}.json`: {source['source']}, {source['width']}x{source['height']}, preset `{settings['preset']}`, "
        f"split `{settings['sequence']['split']}`, {run['iteration']} iterations, seed {run['seed']}, "
        f"{run['gaussians']} Gaussians at the end, training PSNR {training['psnr_full']:.2f} dB, "
        f"lambda_lap {run['lambda_lap']:.3g}, {run['seconds'] / 60:.0f} minutes and "
        f"{run['peak_memory_bytes'] / 1e9:.2f} GB on {counted_of(run['threads'], 'thread')} of {machine['processor']} "
        f"({machine['cores']} cores), {run['started'][:10]}, revision {run['commit']}."
    )


def stored(clip: str) -> dict[str, dict]:
    """The recorded runs on a clip by name."""
    return {file.stem: loaded(file) for file in sorted(RESULTS.glob(f"{clip}_*.json"))}


def every_clip() -> str:
    """The tables of all clips, and a line for each run."""
    found = {clip: records for clip in CLIPS if (records := stored(clip))}
    made = [part for clip, records in found.items() for part in (table(records), missing(clip, records))]
    runs = "\n".join(about(name, metrics) for records in found.values() for name, metrics in records.items())
    return "\n\n".join([*filter(None, made), RANGE, runs])


def of_pulling() -> str:
    """The table of every eighth frame of pulling."""
    short = {name: metrics for name, metrics in stored("pulling").items() if split_of(metrics) == EVERY_EIGHTH}
    return f"{table(short)}\n\n{MORE} {RANGE}"


PROGRAM = Program(
    __name__, ("results/README.md", "../README.md"), {"runs": every_clip, "pulling": of_pulling}, "", record,
    {"run": RUN, "name": {}, "commit": {}},
)  # fmt: skip
