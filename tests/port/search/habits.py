"""Judge each mistake of `habits.toml`, and count what the search says of it.

    python tests/port/search/habits.py [ID ...] [--search SECONDS] [--record]

A mistake is *named* if the lines of the search, or the first mistake of the list that is named, have the words of the
entry; *placed* if they have another text in the right file of the definition; *wrong* if they say anything else; *none*
if they say nothing. The set was written beside the search, so these are no blind rates. `--record` writes the counts
into `docs/results/habits.json`.
"""

import argparse
import contextlib
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "unseen" / "by_hand"))
import hand_port  # noqa: E402

from endotsr.port.judge.npy import write_npy  # noqa: E402
from endotsr.port.judge.store import golden_folder, read_golden  # noqa: E402
from endotsr.port.judge.verdict import judge  # noqa: E402
from endotsr.port.search.find import explained, sentences  # noqa: E402
from endotsr.training.runs.files import write_json  # noqa: E402
from endotsr.training.runs.machine import dated  # noqa: E402

GOLDEN = read_golden(golden_folder())
EVERY: list[dict[str, Any]] = tomllib.loads((HERE / "habits.toml").read_text(encoding="utf-8"))["mistake"]
MISTAKES = {one["id"]: one for one in EVERY}
OUTCOMES = ("named", "placed", "wrong", "none", "passed")
RECORD = HERE.parents[2] / "docs" / "results" / "habits.json"


@contextlib.contextmanager
def answered(operation: str, edit: Sequence[Sequence[str]]) -> Iterator[Path]:
    """A folder with the answers of the edited port to the cases of one operation."""
    port = hand_port.operations([tuple(one) for one in edit])
    with tempfile.TemporaryDirectory() as scratch:
        for case in GOLDEN.cases:
            if case.operation != operation:
                continue
            with contextlib.suppress(ValueError, IndexError, ZeroDivisionError):
                found = hand_port.answer(port, operation, GOLDEN.inputs(case), case.settings)
                for name in case.outputs:
                    write_npy(Path(scratch) / case.name / f"{name}.npy", found[name])
        yield Path(scratch)


def report_on(operation: str, folder: Path):
    """The judge's report on one operation alone."""
    cases = [case for case in GOLDEN.cases if case.operation == operation]
    return judge(GOLDEN._replace(cases=cases), folder, "float64", level=3)


def sentences_on(entry: dict[str, Any], seconds: float = 8.0) -> list[str]:
    """What the search says of a mistake."""
    with answered(entry["operation"], entry["edit"]) as folder:
        return sentences(explained(GOLDEN, folder, "float64", 3, entry["operation"], seconds))


def outcome_of(entry: dict[str, Any], seconds: float) -> tuple[str, str]:
    """The outcome of a mistake, and the text that decides it."""
    with answered(entry["operation"], entry["edit"]) as folder:
        report = report_on(entry["operation"], folder)
        if not any(o.status == "refused" for case in report.cases for o in case.outputs):
            return "passed", ""
        lines = sentences(explained(GOLDEN, folder, "float64", 3, entry["operation"], seconds))
    named = [f"{s.flag}: {s.title} ({s.wrong})" for s in report.suspects[:1] if s.named]
    certain = bool(named) and report.suspects[0].whole
    said = "\n".join((named if certain else lines) or named)
    if not said:
        return "none", ""
    if re.search(entry["says"], said):
        return "named", said
    return ("placed" if re.search(entry["place"], said) else "wrong"), said


def main(words: list[str]) -> int:
    """Judge the set, or the named mistakes of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ids", nargs="*", metavar="ID")
    parser.add_argument("--search", type=float, default=8.0, metavar="SECONDS")
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args(words)
    listed: dict[str, list[str]] = {name: [] for name in OUTCOMES}
    for entry in EVERY:
        if not options.ids or entry["id"] in options.ids:
            outcome, said = outcome_of(entry, options.search)
            listed[outcome].append(entry["id"])
            print(f"{entry['id']}: {outcome}\n    {said.partition(chr(10))[0]}", flush=True)
    print({name: len(ids) for name, ids in listed.items()})
    if options.record and not options.ids:
        write_json(RECORD, dated({"golden": GOLDEN.manifest.version, "outcomes": listed}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
