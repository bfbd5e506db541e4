"""Write the generated parts of docs/bench.md, and its pictures, from the JSON files of `endotsr bench all`.

    python docs/pages/bench.py              from docs/results
    python docs/pages/bench.py FOLDER       from the files of another folder; pictures are written there too

To measure: `endotsr bench all --out docs/results`, on a machine that has nothing else to do.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bench_parts
from marks import read_json, write_marked

from endotsr.bench import charts
from endotsr.bench.suite import PEERS_FILE, SCALING_FILE, STAGES_FILE, START_FILE
from endotsr.errors import InputError

DOCS = Path(__file__).parents[1]
PAGE, RESULTS = DOCS / "bench.md", DOCS / "results"
FILES = {"stages": STAGES_FILE, "scaling": SCALING_FILE, "peers": PEERS_FILE, "start": START_FILE}
COMMAND = "endotsr bench all --out FOLDER"


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """The four measurements by name. Raises: InputError if a file is missing or cannot be read."""
    return {name: read_json(folder / file, COMMAND) for name, file in FILES.items()}


def read_runs(folder: Path) -> dict[str, dict[str, Any]]:
    """Records of whole runs in the same folder, by name."""
    records = {path.stem: read_json(path, "docs/results/record.py") for path in sorted(folder.glob("pulling*.json"))}
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
    if len(words) > 1:
        sys.exit(__doc__)
    folder = Path(words[0]) if words else RESULTS
    try:
        found = read(folder)
        write_marked(page, fragments(found, read_runs(folder)), "bench")
    except InputError as error:
        sys.exit(f"error: {error}")
    charts.stage_bars(found["stages"]["cases"], folder / "bench_stages.png")
    charts.scaling_curves(found["scaling"]["axes"], folder / "scaling.png")


if __name__ == "__main__":
    main(sys.argv[1:])
