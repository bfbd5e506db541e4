"""Record a run: docs/results/NAME.json from RUN/metrics.json, and the tables made from all recorded runs.

    python docs/results/record.py RUN NAME COMMIT   add or replace one record, then rewrite the tables
    python docs/results/record.py                   rewrite the tables only

COMMIT is the revision of this repository that made the run.

The tables stand in docs/results/README.md and in README.md, between the `results:start` and `results:end` marks.
"""

import json
import sys
from pathlib import Path

from endotsr.evaluation.run import PUBLISHED
from endotsr.report.tables import markdown
from endotsr.runs.files import write_json

FOLDER = Path(__file__).parent
START, END = "<!-- results:start (made by docs/results/record.py) -->", "<!-- results:end -->"
COLUMNS = (
    ("psnr_full", "PSNR full, dB", "{:.2f}"),
    ("psnr_tissue", "PSNR tissue, dB", "{:.2f}"),
    ("ssim_full", "SSIM full", "{:.4f}"),
    ("lpips", "LPIPS [0,1]", "{:.4f}"),
    ("lpips_symmetric", "LPIPS [-1,1]", "{:.4f}"),
)


def record(run: Path, name: str, commit: str) -> None:
    """Copy the metrics of a run; paths of the machine are reduced to the name of the folder."""
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    source = metrics["run"]["input"]
    source["source"] = Path(source["source"]).name
    metrics["run"]["commit"] = commit
    metrics["published"] = [row for clip, row in PUBLISHED.items() if clip in source["source"]]
    write_json(FOLDER / f"{name}.json", metrics)


def rows(records: dict[str, dict]) -> list[tuple[str, dict]]:
    """Runs, then the baselines of the first run, then what was published."""
    out = [(f"endotsr, `{name}.json`", r["held_out"]["mean"]) for name, r in records.items()]
    first = next(iter(records.values()))
    out += [(b["label"], b["mean"]) for b in first["baselines"].values()]
    return out + [(p["label"], p) for p in first["published"]]


def table(records: dict[str, dict]) -> str:
    """Held-out means as Markdown, and one line on each run."""
    cells = [
        [label, *(f.format(values[key]) if values.get(key) is not None else "-" for key, _, f in COLUMNS)]
        for label, values in rows(records)
    ]
    return (
        markdown(["Held-out frames", *(c[1] for c in COLUMNS)], cells)
        + "\n\n"
        + "\n".join(about(name, r) for name, r in records.items())
    )


def about(name: str, metrics: dict) -> str:
    """What was run, when, on what."""
    run, training, machine = metrics["run"], metrics["training"]["mean"], metrics["run"]["machine"]
    source, settings = run["input"], run["settings"]
    return (
        f"- `{name}.json`: {source['source']}, {source['width']}x{source['height']}, preset `{settings['preset']}`, "
        f"split `{settings['sequence']['split']}`, {run['iteration']} iterations, seed {run['seed']}, "
        f"{run['gaussians']} Gaussians at the end, training PSNR {training['psnr_full']:.2f} dB, "
        f"lambda_lap {run['lambda_lap']:.3g}, {run['seconds'] / 60:.0f} minutes and "
        f"{run['peak_memory_bytes'] / 1e9:.2f} GB on {run['threads']} threads of {machine['processor']} "
        f"({machine['cores']} cores), {run['started'][:10]}, revision {run['commit']}."
    )


def replace_marked(path: Path, text: str) -> None:
    """Put `text` between the marks of a file."""
    old = path.read_text(encoding="utf-8")
    head, _, rest = old.partition("<!-- results:start")
    tail = rest.partition(END)[2]
    path.write_text(f"{head}{START}\n{text}\n{END}{tail}", encoding="utf-8")


def main(words: list[str]) -> None:
    """The command."""
    if len(words) == 3:
        record(Path(words[0]), words[1], words[2])
    elif words:
        sys.exit(__doc__)
    records = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in sorted(FOLDER.glob("pulling*.json"))}
    if records:
        for path in (FOLDER / "README.md", FOLDER.parents[1] / "README.md"):
            replace_marked(path, table(records))


if __name__ == "__main__":
    main(sys.argv[1:])
