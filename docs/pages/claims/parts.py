"""The generated tables of docs/claims.md and docs/guides/sweep.md: ablations, other held-out frames, cost."""

import math
from typing import Any

import numpy as np

from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.ablation_page import UNRECORDED, increment_table, level_table
from pages.claims.verdicts import FULL, NOT_YET

BEGIN_MINUTES = 1.0  # of a worker before its first iteration, kernels not compiled before
PLANNED_RUNS, PLANNED_CORES = (15, 42), (2, 8, 16, 64)
WIDTH = 640  # px, of the recorded clip at full size
Record = Any  # content of a file of docs/results


def tables(found: Record | None) -> str:
    """Means and paired differences of an ablation, and the conditions of the measurement."""
    if found is None:
        return NOT_YET
    runs, machine = found["runs"], found["machine"]
    made = (
        f"{runs['finished']} of {runs['planned']} runs, {len(runs['failed'])} failed; {machine['processor']}, "
        f"{machine['cores']} cores, {found['date'][:10]}."
    )
    parts = [made] if all(row["input_recorded"] for row in found["increments"]) else [made, UNRECORDED]
    for split in dict.fromkeys(level["split"] for level in found["levels"]):
        parts += [f"Held out: `{split}`", level_table(found, split), differences(found, split)]
    return "\n\n".join(parts)


def differences(found: Record, split: str) -> str:
    """The paired differences without PSNR on tissue, which differs from the full PSNR of a frame by a constant."""
    return "\n".join(row for row in increment_table(found, split).splitlines() if "| PSNR tissue, dB |" not in row)


def protocols(ablations: list[Record | None], runs: list[Record]) -> str:
    """Held-out PSNR on tissue by clip and split: training frames, the model, its cross-fade and the baselines."""
    rows = [[*key, *_protocol_cells(members)] for key, members in sorted(_by_split(ablations, runs).items(), key=_clip)]
    if not rows:
        return NOT_YET
    heads = ("clip", "held out, preset", "runs", "training frames", "model", "cross-fade", "blend of neighbours",
             "optical flow")  # fmt: skip
    return markdown(heads, rows)


def _clip(group: tuple[tuple[str, str], list[Record]]) -> bool:
    """Order of the clips: pulling comes first."""
    return "pulling" not in group[0][0]


def _by_split(ablations: list[Record | None], runs: list[Record]) -> dict[tuple[str, str], list[Record]]:
    """Rows with the keys of a sweep by clip and split, preset and size: of the ablations, else of recorded runs."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for row in (row for found in ablations if found is not None for row in found["rows"]):
        if row["configuration"] == FULL:
            size = "" if row.get("width", WIDTH) == WIDTH else f" at {row['width']}x{row['height']}"
            groups.setdefault((row["sequence"], f"{row['split']}, {row['preset']}{size}"), []).append(row)
    ablated = set(groups)
    for run in runs:
        sequence, preset = run["run"]["settings"]["sequence"], run["run"]["settings"]["preset"]
        split = sequence["split"] + (f" {sequence['block_length']}" if sequence["split"] in ("blocks", "end") else "")
        key = run["run"]["input"]["source"], f"{split}, {preset}"
        if key in ablated:  # the same runs, or runs of the same kind without their pairs
            continue
        faded = (run.get("cross_fade") or {}).get("mean") or {}
        row = {
            "psnr_tissue": run["held_out"]["mean"]["psnr_tissue"],
            "training_psnr_tissue": run["training"]["mean"]["psnr_tissue"],
            "cross_fade_psnr_tissue": faded.get("psnr_tissue"),
            "baselines": run["baselines"],
        }
        groups.setdefault(key, []).append(row)
    return groups


def _protocol_cells(rows: list[Record]) -> list[str]:
    def mean(key: str) -> str:
        values = [row[key] for row in rows if row.get(key) is not None]
        return f"{np.mean(values):.2f}" if values else "-"

    def baseline(name: str) -> str:
        value = rows[0]["baselines"].get(name, {}).get("mean", {}).get("psnr_tissue")
        return "-" if value is None else f"{value:.2f}"

    model = [mean(key) for key in ("training_psnr_tissue", "psnr_tissue", "cross_fade_psnr_tissue")]
    return [str(len(rows)), *model, baseline("two_neighbours"), baseline("flow_interpolation")]


def divided(found: Record | None) -> str:
    """Measured time of one sweep for several divisions of the cores of a machine."""
    if found is None:
        return "Not measured yet (`python docs/make.py claims.sweep_cost`)."
    first = found["rows"][0]["seconds"]
    rows = [
        [str(row["workers"]), str(row["threads"]), f"{row['seconds']:.0f}", f"{np.mean(row['runs']):.0f}",
         f"{first / row['seconds']:.2f}"]
        for row in found["rows"]
    ]  # fmt: skip
    runs = len(found["rows"][0]["runs"])
    about = f"{runs} runs of {found['iterations']} iterations, {found['sequence']}, {found['machine']['processor']}."
    heads = ("runs at a time", "threads of each", "sweep, seconds", "one run, seconds", "speed")
    return f"{about}\n\n{markdown(heads, rows)}"


def cost(found: Record | None, runs: list[Record]) -> str:
    """Hours of sweeps on several numbers of cores, from the measured seconds of one run."""
    rows = found["rows"] if found is not None else []
    whole = [row for row in rows if "fixed" not in row["configuration"]]  # the others train half of the iterations
    measured = [(row["seconds"], row["threads"]) for row in whole
                if row.get("seconds") and row.get("threads") and row["preset"] == "paper"]  # fmt: skip
    machine = f" on {found['machine']['processor']}, {found['date'][:10]}" if found is not None and measured else ""
    measured = measured or [
        (run["run"]["seconds"], run["run"]["threads"]) for run in runs if run["run"]["settings"]["preset"] == "paper"
    ]
    if not measured:
        return NOT_YET
    core_minutes = float(np.median([seconds * threads / 60 for seconds, threads in measured]))
    cells = [
        [str(count), *(f"{planned_hours(count, cores, core_minutes):.1f}" for cores in PLANNED_CORES)]
        for count in PLANNED_RUNS
    ]
    about = f"One run takes {core_minutes:.0f} core minutes (median of {len(measured)} measured{machine})."
    return f"{about}\n\n" + markdown(("runs", *(f"{n} cores, hours" for n in PLANNED_CORES)), cells)


def planned_hours(runs: int, cores: int, core_minutes: float, threads: int = 1, begin: float = BEGIN_MINUTES) -> float:
    """Hours until the last of the runs has ended, planned from the time of one run.

    W workers need ceil(R / W) rounds for R runs of equal length. A run on k threads needs at least 1 / k of its core
    minutes, so threads never finish a sweep sooner than workers. The start of a worker (imports, kernels, the sequence)
    is paid once. Workers are assumed not to slow each other down, as on separate machines.

    runs          in the sweep
    cores         of all machines together, divided among workers of `threads` threads
    core_minutes  of one run: minutes on one thread
    begin         minutes of a worker before its first iteration
    Raises:       ValueError if there is no worker.
    """
    workers = cores // threads
    if workers < 1:
        raise ValueError(f"{cores} cores give no worker of {threads} threads")
    return (begin + math.ceil(runs / workers) * core_minutes / threads) / 60 if runs else 0.0
