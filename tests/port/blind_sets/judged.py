"""Judge each mistake of a blind set once, and print its sentence and the answer of the report.

    python tests/port/blind_sets/judged.py SET.toml [NUMBER ...] [--out FILE.json] [--search SECONDS]

The outcome of each answer is given by a reader, by the protocol of tests/port/blind.py. The file of `--out` has the
answers by number, so that two versions of the judge can be compared.
"""

import argparse
import json
import sys
import tempfile
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent / name) for name in ("unseen/by_hand", "unseen/of_training")]
sys.path.insert(0, str(HERE.parents[2] / "golden"))
import measure  # noqa: E402
import training_mistakes  # noqa: E402

from endotsr.port.judge.report import answer  # noqa: E402
from endotsr.port.search.find import explain  # noqa: E402
from makers.copies import Edit  # noqa: E402

SECONDS = 16.0  # of the search, as `golden run`
training_mistakes.OPERATIONS = (*training_mistakes.OPERATIONS, "objective")


def answer_to(entry: dict, seconds: float) -> list[str]:
    """The first answer of the report, and the cases that it refuses."""
    if "edit" in entry:
        report = measure.report_on([tuple(pair) for pair in entry["edit"]], seconds)
    else:
        with tempfile.TemporaryDirectory() as scratch:
            edits = tuple(Edit(*change) for change in entry["changes"])
            report = training_mistakes.in_reference(measure.GOLDEN, edits, Path(scratch))
            if seconds:
                explain(measure.GOLDEN, report, Path(scratch), seconds)
    asked = [case for case in report.cases if any(o.status == "refused" for o in case.outputs)]
    return [*answer(report), f"refused cases: {', '.join(case.name for case in asked) or 'none'}"]


def main(words: list[str]) -> int:
    """Judge the set, or the named mistakes of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path)
    parser.add_argument("numbers", nargs="*", type=int)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--search", type=float, default=SECONDS, metavar="SECONDS")
    options = parser.parse_args(words)
    table, answers = tomllib.loads(options.set.read_text(encoding="utf-8")), {}
    entries = [*table.get("by_hand", []), *table.get("reference", [])]
    for entry in entries:
        if not options.numbers or entry["number"] in options.numbers:
            began = time.monotonic()
            try:
                lines = answer_to(entry, options.search)
            except Exception as error:  # of the mistaken port, before it has an answer
                lines = [f"the port ends with an error: {error!r}"]
            answers[str(entry["number"])] = lines
            print(f"{entry['number']} {entry['operation']}: {entry['text']} ({time.monotonic() - began:.0f} s)")
            print(*(f"    {line}" for line in lines), sep="\n", flush=True)
    if options.out:
        options.out.write_text(json.dumps(answers, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
