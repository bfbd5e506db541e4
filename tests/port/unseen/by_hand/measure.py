"""Judge each mistake of `edits.toml` alone, and count what the first answer of the report says.

    python tests/port/unseen/by_hand/measure.py [ID ...] [--sample N] [--search SECONDS] [--jobs 2] [--said]
                                                        [--record NAME]

The port by hand is run in float64 on all operations and on `render`, up to level 3. Each mistake has one outcome:

    explained a change of the definition is said with which it gives every output of the first wrong operation, in every
              case, as the port wrote it; or the words of the entry are in the change that is said
    named     the first known mistake that the report names has the words of the entry
    told      none is named, and the diagnosis, which needs no list, has the words
    by case   none is named, and only the title of the refused cases has the words
    located   none of these, but the first operation is right, and one output alone or the reverse pass alone is wrong
    none      nothing that helps
    wrong     the first known mistake that is named has other words
    passed    nothing is refused

`explained`, `named` and `told` count as recognised. A word of `says` that stands alone has to be in the relation that
the diagnosis states, not in the name of an output. `--record` writes the outcomes into `record.json` under a name:
"before" is the judge of the day on which the set was written, "now" that of today. The interval of a rate is that of
Wilson, 95 %.
"""

import argparse
import functools
import json
import math
import multiprocessing
import random
import re
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))
import hand_port

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.judge.verdict import judge
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated

try:  # a judge that has no search is measured without one
    from endotsr.port.search.find import explain  # type: ignore[import-not-found]
except ImportError:
    explain = None

HERE = Path(__file__).parent
RECORD = HERE / "record.json"
WRONG_PASS = "wrong in another way"  # of an explanation of the forward outputs alone
KNOWN = tomllib.loads((HERE / "same.toml").read_text(encoding="utf-8"))
OUTCOMES = ("explained", "named", "told", "by case", "located", "none", "wrong", "passed")
GOLDEN = read_golden(golden_folder())
ASKED = [case for case in GOLDEN.cases if case.operation in hand_port.OPERATIONS]
NOT_PORTED = sorted({case.operation for case in GOLDEN.cases}.difference(hand_port.OPERATIONS))
FIRST = re.compile(r"first wrong: operation (\w+)")
NOTHING = re.compile(r"have? another value|has another value|no simple relation|only at some pixels")  # no diagnosis


class Outcome(NamedTuple):
    """What the judge said of one mistake."""

    id: str
    outcome: str
    operation: bool  # whether the first wrong operation is that of the entry
    said: str  # the first answer, in one line


def mistakes() -> list[dict]:
    """The entries of `edits.toml`."""
    return tomllib.loads((HERE / "edits.toml").read_text(encoding="utf-8"))["mistake"]


def report_on(edits, seconds: float = 0.0) -> Report:
    """The judge's report on the port with these edits, after a search of so many seconds for the cause.

    An operation that raises leaves its outputs out.
    """
    port = hand_port.operations(edits)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "not_ported.txt").write_text("\n".join(NOT_PORTED))
        for case in ASKED:
            try:
                found = hand_port.answer(port, case.operation, GOLDEN.inputs(case), case.settings)
            except (ValueError, IndexError, ZeroDivisionError):
                continue
            for name in case.outputs:
                write_npy(folder / case.name / f"{name}.npy", found[name])
        report = judge(GOLDEN, folder, "float64", level=3)
        if seconds and explain is not None:
            explain(GOLDEN, report, folder, seconds)
        return report


def alternatives_of(said: str) -> list[str]:
    """The parts between the bars that stand in no parentheses."""
    parts, depth = [""], 0
    for sign in re.findall(r"\\.|.", said):
        depth += (sign == "(") - (sign == ")")
        if sign == "|" and not depth:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def has_words(entry: dict, text: str, alone: str = "") -> bool:
    """Whether one of the alternatives of `says` is in a text; "&" binds more strongly than "|".

    alone   a text in which a word that stands alone has to be; by default the same
    """
    plain, strict = (one.lower().replace("_", " ") for one in (text, alone or text))
    alternatives = [one.split(" & ") for said in entry["says"] for one in alternatives_of(said)]
    return any(all(re.search(word, plain if len(one) > 1 else strict) for word in one) for one in alternatives)


def relations(lines: list[str]) -> tuple[str, str]:
    """What a diagnosis says of the outputs beyond that they are wrong: with their names, and without names and axes."""
    kept = []
    for line in lines:
        name, _, text = line.strip().partition(": ")
        told = [part for part in text.split("; ") if not NOTHING.search(part)]
        kept += [(name, "; ".join(told))] if told else []
    named = " | ".join(f"{name}: {told}" for name, told in kept)
    return named, re.sub(r" of axis \d", "", " | ".join(told for _, told in kept))


def outcome_of(entry: dict, report: Report) -> Outcome:
    """The outcome by the first answer of the report."""
    if not any(o.status != "passed" for case in report.cases for o in case.outputs):
        return Outcome(entry["id"], "passed", False, "")
    lines = report.diagnosis
    found = FIRST.search(lines[0]) if lines else None
    operation = bool(found) and found[1] == entry["operation"]
    if causes := getattr(report, "causes", []):
        said = " ".join(causes)
        exact = operation and WRONG_PASS not in said
        return Outcome(entry["id"], "explained" if exact or has_words(entry, said) else "wrong", operation, said)
    first = next((s for s in report.suspects[:1] if s.named), None)
    named = f"{first.flag}: {first.title} ({first.wrong})" if first else ""
    said = named or " | ".join(line.strip() for line in lines)
    return Outcome(entry["id"], kind_of(entry, named, lines, operation), operation, said)


def kind_of(entry: dict, named: str, lines: list[str], operation: bool) -> str:
    """The outcome of a report that refuses something: the name first, then what the diagnosis says."""
    if named:
        flag, of = named.partition(":")[0], entry["id"]
        if flag in KNOWN["same"].get(of, ()):
            return "named"
        return "named" if has_words(entry, named) and flag not in KNOWN["other"].get(of, ()) else "wrong"
    cases = [line for line in lines if line.strip().startswith("only in ") and " cases: " in line]
    with_names, alone = relations([line for line in lines[1:] if line not in cases])
    if alone and has_words(entry, with_names, alone):
        return "told"
    if has_words(entry, " ".join(cases)):
        return "by case"
    return "located" if operation and " alone" in lines[0] else "none"


def one(entry: dict, seconds: float = 0.0) -> Outcome:
    """Judge one mistake, after a search of so many seconds."""
    return outcome_of(entry, report_on(entry["edit"], seconds))


def interval(good: int, of: int) -> tuple[float, float]:
    """The 95 % interval of Wilson."""
    z, p = 1.96, good / of
    middle, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return (middle - half) / (1 + z * z / of), (middle + half) / (1 + z * z / of)


def rates(outcomes: list[Outcome]) -> dict[str, list[float]]:
    """Count, number asked, and the interval, by what is counted; an entry that changes nothing does not count."""
    outcomes = [o for o in outcomes if o.id not in KNOWN["equivalent"]]
    kinds, of = Counter(o.outcome for o in outcomes), len(outcomes)
    counted = {
        "refused": of - kinds["passed"],
        "right operation first": sum(o.operation for o in outcomes),
        "recognised": kinds["explained"] + kinds["named"] + kinds["told"],
        "recognised, or the case or the one wrong pass said": of - kinds["none"] - kinds["wrong"] - kinds["passed"],
        "wrongly named": kinds["wrong"],
    }
    return {name: [good, of, *(round(end, 4) for end in interval(good, of))] for name, good in counted.items()}


def keep(name: str, outcomes: list[Outcome], seconds: float) -> None:
    """Write a run into the record, beside those of other names."""
    listed = {kind: [o.id for o in outcomes if o.outcome == kind] for kind in OUTCOMES}
    late = [o.id for o in outcomes if not o.operation]
    run = {"golden": GOLDEN.manifest.version, "seconds": round(seconds), "rates": rates(outcomes)}
    runs = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    write_json(RECORD, runs | {name: dated(run | {"outcomes": listed, "another operation first": late})})


def main(words: list[str]) -> int:
    """Run, print every mistake that is not recognised and the rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ids", nargs="*", metavar="ID")
    parser.add_argument("--jobs", type=int, choices=(1, 2), default=1)
    parser.add_argument("--record", metavar="NAME", default="")
    parser.add_argument("--said", action="store_true", help="print the first answer of every mistake")
    parser.add_argument("--search", type=float, default=16.0, metavar="SECONDS", help="of the judge for each mistake")
    parser.add_argument("--sample", type=int, metavar="N", help="N mistakes drawn at random, the same every time")
    options = parser.parse_args(words)
    entries = [entry for entry in mistakes() if not options.ids or entry["id"] in options.ids]
    if options.sample:
        entries = random.Random(0).sample(entries, options.sample)
    began, right = time.monotonic(), report_on(())
    if right.diagnosis or right.level < 3:
        raise SystemExit("the right port does not pass:\n" + "\n".join(right.diagnosis))
    with multiprocessing.Pool(options.jobs) as pool:
        outcomes = []
        for outcome in pool.imap(functools.partial(one, seconds=options.search), entries):
            outcomes.append(outcome)
            if options.said or outcome.outcome not in ("explained", "named", "told"):
                operation = "" if outcome.operation else ", another operation first"
                print(f"{outcome.id}: {outcome.outcome}{operation}\n    {outcome.said}", flush=True)
    table = rates(outcomes)
    for name, (good, of, low, high) in table.items():
        print(f"{name}: {good} of {of}, {100 * good / of:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)")
    print(dict(Counter(o.outcome for o in outcomes)), f"{time.monotonic() - began:.0f} s")
    if options.record and len(entries) == len(mistakes()):
        keep(options.record, outcomes, time.monotonic() - began)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
