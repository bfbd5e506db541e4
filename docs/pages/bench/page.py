"""Measure the distribution of time, and write the generated parts of docs/bench.md and its pictures.

    python docs/make.py bench measure [WHAT ...] [--scenes FILE ...] [--out FOLDER]
                                            on an otherwise idle machine: start, stages, peers and scaling, or the
                                            named measurements; `effects` belongs to docs/effects.md
    python docs/make.py bench              the page from docs/results
    python docs/make.py bench FOLDER       from the files of another folder; pictures are written there too

The command `endotsr bench` only times the stages on this machine.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from pages.bench import charts as bench_charts
from pages.bench import parts as bench_parts
from pages.bench import suite as bench_suite
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, RESULTS = DOCS / "bench.md", DOCS / "results"
FILES = {name: bench_suite.FILES[name] for name in ("stages", "scaling", "peers", "start")}
COMMAND = "python docs/make.py bench measure"


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """The four measurements by name. Raises: InputError if a file is missing or cannot be read."""
    return {name: read_json(folder / file, COMMAND) for name, file in FILES.items()}


def read_runs(folder: Path) -> dict[str, dict[str, Any]]:
    """Records of whole runs in the same folder, by name."""
    records = {
        path.stem: read_json(path, "docs/pages/full_size/record.py") for path in sorted(folder.glob("pulling*.json"))
    }
    return {name: record["run"] for name, record in records.items()}


def fragments(found: Mapping[str, dict[str, Any]], runs: Mapping[str, dict[str, Any]]) -> dict[str, str]:
    """Every generated part by name.

    found   the results of the four measurements, by the names in FILES
    runs    records of whole runs
    """
    stages, scaling, peers, start = (found[name] for name in FILES)
    return {
        "machine": bench_parts.machine(stages),
        "targets": bench_parts.targets(stages, scaling, peers, start, runs),
        "stages": bench_parts.stages(stages),
        "gain": bench_parts.gain(stages),
        "cases": bench_parts.cases(stages),
        "scaling": bench_parts.scaling(scaling),
        "peers": bench_parts.peers(peers),
        "start": bench_parts.start(start),
        "runs": bench_parts.runs(runs),
    }


def main(words: list[str], page: Path = PAGE) -> None:
    """The command."""
    if len(words) > 1 and words[0] != "measure":
        sys.exit(__doc__)
    folder = Path(words[0]) if words else RESULTS
    try:
        if words[:1] == ["measure"]:
            return bench_suite.main(words[1:])
        found = read(folder)
        write_marked(page, fragments(found, read_runs(folder)), "bench")
    except InputError as error:
        sys.exit(f"error: {error}")
    bench_charts.stage_bars(found["stages"]["cases"], folder / "bench_stages.png")
    bench_charts.scaling_curves(found["scaling"]["axes"], folder / "scaling.png")
