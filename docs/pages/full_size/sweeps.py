"""Open questions about the method as files of sweeps, and a table of what is measured.

    ln -s /path/to/endonerf_pulling docs/results/sweeps/               and the other clip, where a file names it
    endotsr sweep docs/results/sweeps/NAME.toml --out DIR
    python docs/make.py full_size.sweeps measure NAME DIR/results.json store the finished runs, then write the tables

The first lines of a file are its question. The tables are in docs/results/README.md. Differences are paired by clip,
split and seed, and are taken to the configuration that `reference` names.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.execute import FINISHED
from endotsr.studies.sweeps.spec import Spec, spec_of
from endotsr.training.runs.files import write_json
from endotsr.untrusted.toml import read_toml
from pages.store.intervals import shown
from pages.store.marks import read_json
from pages.store.program import RESULTS, Program
from pages.store.tables import means

FOLDER = RESULTS / "sweeps"


PLACE = "simulated"  # stands for the clips, which need not be at hand to read a file
KEPT = ("sequence", "split", "configuration", "seed", "iterations", "gaussians", "seconds", "measures",
        "arrays_sha256", "machine", "versions", "psnr_full", "psnr_tissue", "ssim_full", "lpips")  # fmt: skip
COLUMNS = (("psnr_full", "PSNR full, dB", 2), ("psnr_tissue", "PSNR tissue, dB", 2), ("ssim_full", "SSIM full", 4),
           ("lpips", "LPIPS [0,1]", 4))  # fmt: skip
Row = dict[str, Any]


def files() -> list[Path]:
    """The files of the sweeps, by name."""
    return sorted(FOLDER.glob("*.toml"))


def question(file: Path) -> str:
    """The comment at the head of a file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    head = lines[: next(i for i, line in enumerate(lines) if not line.startswith("#"))]
    return " ".join(line.lstrip("# ") for line in head)


def read(file: Path) -> tuple[Spec, list[str]]:
    """The checked sweep of a file with a stand-in for its clips, and the names of the clips."""
    data = read_toml(file)
    clips = [str(name) for name in data["sequences"]]
    return spec_of(data | {"sequences": [PLACE]}, str(file), file.parent), clips


def planned(file: Path) -> int:
    """Number of runs of a file."""
    spec, clips = read(file)
    return len(clips) * len(spec.seeds) * max(1, len(spec.splits)) * len(spec.configurations)


def reference(spec: Spec, name: str) -> str:
    """The configuration that the differences of `name` are taken to.

    That is `base` with the words of `name` after its first, such as `base frozen` of `A frozen`. Without one it is the
    first configuration that continues a shared checkpoint, or the first of all.
    """
    names = [configuration.name for configuration in spec.configurations]
    continued = [configuration.name for configuration in spec.configurations if configuration.start]
    base = " ".join(["base", *name.split()[1:]])
    return base if base in names else (continued or names)[0]


def rows_of(file: Path) -> list[Row]:
    """The stored runs of a sweep; none before it was measured."""
    record = file.with_suffix(".json")
    return read_json(record, "python docs/make.py full_size.sweeps")["rows"] if record.exists() else []


def differences(rows: list[Row], configuration: str, to: str, metric: str) -> list[float]:
    """The differences of a metric between two configurations, one for each clip, split and seed that both have.

    Raises: InputError if the two runs of a pair read different frames.
    """
    found = {_run(row): row for row in rows}
    pairs = [
        (row, other)
        for (*place, name, seed), row in found.items()
        if name == configuration and (other := found.get((*place, to, seed)))
    ]
    for row, other in pairs:
        if row["arrays_sha256"] != other["arrays_sha256"]:
            raise InputError(
                f"{configuration} and {to}, seed {row['seed']}: the runs of a pair must read the same frames"
            )
    return [row[metric] - other[metric] for row, other in pairs if None not in (row[metric], other[metric])]


def table(file: Path) -> str:
    """The measured runs of a file, one table for each clip and split."""
    spec, rows, parts = read(file)[0], rows_of(file), []
    for clip, split in dict.fromkeys((row["sequence"], row["split"]) for row in rows):
        of = [row for row in rows if (row["sequence"], row["split"]) == (clip, split)]
        lines = [_line(of, name, reference(spec, name)) for name in (one.name for one in spec.configurations)]
        heads = [f"`{file.stem}`: {clip}, {split}", "seeds", *(label for _, label, _ in COLUMNS)]
        parts.append(markdown(heads, lines))
    return "\n\n".join(parts)


def _line(rows: list[Row], name: str, to: str) -> list[str]:
    of = [row for row in rows if row["configuration"] == name]
    level = name == to or all(row["configuration"] != to for row in rows)  # without a reference, no differences
    if level:
        cells = means(of, [(key, digits) for key, _, digits in COLUMNS])
    else:
        cells = [shown(differences(rows, name, to, key), digits, "+") for key, _, digits in COLUMNS]
    return [name if level else f"{name}, difference to {to}", str(len(of)), *cells]


def tables() -> str:
    """The list of the sweeps, and the tables of those that are measured."""
    lines = [
        [f"`{file.stem}`", question(file), str(planned(file)), str(len(rows_of(file)))] for file in files()
    ]  # fmt: skip
    listed = markdown(["Sweep", "Question", "runs", "of them measured"], lines)
    return "\n\n".join([listed, *filter(None, map(table, files()))])


def store(name: str, results: Path) -> None:
    """Add the finished runs of a sweep to its record; a run replaces the stored one of its name."""
    file = FOLDER / f"{name}.toml"
    if file not in files():
        raise InputError(f"{name}: not a sweep of {FOLDER}; use one of: {', '.join(f.stem for f in files())}")
    found = read_json(results, "endotsr sweep")["rows"]
    by_run = {_run(row): row for row in [*rows_of(file), *_finished(found)]}
    write_json(file.with_suffix(".json"), {"rows": [by_run[run] for run in sorted(by_run)]})


def _run(row: Row) -> tuple[str, ...]:
    return tuple(str(row[key]) for key in ("sequence", "split", "configuration", "seed"))


def _finished(rows: Iterable[Row]) -> list[Row]:
    return [{key: row.get(key) for key in KEPT} for row in rows if row["status"] == FINISHED]


PROGRAM = Program(
    __name__, "results/README.md", {"table": tables}, "", lambda options: store(options.name, options.results),
    {"name": {}, "results": {"type": Path}},
)  # fmt: skip
