"""Put existing programs through the golden cases: python tests/port/programs/survey.py [OPTIONS]

    --python PYTHON   an interpreter that has the programs (pip install gsplat splax torch); by default this one
    --program NAME    this one alone; what is known of the others is kept
    --write           replace docs/results/golden_programs.json and its tables in docs/who_computes_what.md

A program that cannot be imported there is left out. The programs run in float32, which all of them support.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import Any

from endotsr.port.judge.command import run_port, write_requests
from endotsr.port.judge.records import CaseReport, Report
from endotsr.port.judge.store import Golden, golden_folder, read_golden
from endotsr.port.judge.verdict import judge

HERE, DOCS = Path(__file__).parent, Path(__file__).parents[3] / "docs"
RESULT, PAGE = DOCS / "results" / "golden_programs.json", DOCS / "who_computes_what.md"
START, END = "<!-- programs:tables:start -->", "<!-- programs:tables:end -->"
PROGRAMS = {  # file: (name, distribution, what is used of it)
    "gsplat_port.py": ("gsplat", "gsplat", "reference in plain PyTorch, by automatic differentiation"),
    "splax_port.py": ("splax", "splax", "harmonics in JAX, by automatic differentiation"),
    "torch_adam_port.py": ("PyTorch", "torch", "torch.optim.Adam"),
}
INTRODUCTION = (
    "Existing programs on the golden cases {golden}, in {precision}. A program answers the operations that it has, "
    "each case alone, with its own code. *Deviation* is the known mistake that the judge names for the refused "
    "outputs; such a deviation can be a choice of the program, not an error. *Largest* is the largest distance from "
    "the expected array, in units of its scale."
)
ABOUT_VERSIONS = "import importlib.metadata as m, sys; print(m.version(sys.argv[1]))"


def version_of(python: str, distribution: str) -> str:
    """The version of an installed distribution, "" if it is not installed."""
    done = subprocess.run([python, "-c", ABOUT_VERSIONS, distribution], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def run(golden: Golden, python: str, file: str) -> Report | None:
    """The judge's report on one program; None if it cannot be run by this interpreter."""
    with tempfile.TemporaryDirectory() as scratch:
        requests, outputs = Path(scratch) / "requests", Path(scratch) / "outputs"
        write_requests(golden, requests, "float32", 2)
        if run_port(f"{python} {HERE / file} {{requests}} {{outputs}}", requests, outputs, 900):
            return None
        return judge(golden, outputs, "float32", level=2)


def rows_of(report: Report) -> list[dict[str, Any]]:
    """One entry for each case that the program answers: passed outputs, deviations by flag and their size."""
    answered = [case for case in report.cases if any(o.status != "missing" for o in case.outputs)]
    return [_row(case) for case in answered]


def _row(case: CaseReport) -> dict[str, Any]:
    wrong = [o for o in case.outputs if o.status != "passed"]
    return {
        "case": case.name,
        "passed": [o.name for o in case.outputs if o.status == "passed"],
        "wrong": [{"output": o.name, "status": o.status, "distance": o.distance} for o in wrong],
        "named": case.looks_like[:2],
    }


def survey(python: str, only: str = "") -> dict[str, Any]:
    """The result for every program that is installed; with `only`, the others as they are known."""
    golden, found = read_golden(golden_folder()), []
    for file, (name, distribution, used) in PROGRAMS.items():
        if only not in ("", name):
            found += [one for one in json.loads(RESULT.read_text())["programs"] if one["program"] == name]
            continue
        version = version_of(python, distribution)
        report = run(golden, python, file) if version else None
        if report is not None:
            named = [{"flag": s.flag, "score": round(s.score, 2)} for s in report.suspects if s.named]
            found.append({"program": name, "version": version, "used": used, "named": named, "cases": rows_of(report)})
    return {"golden": golden.manifest.version, "precision": "float32", "programs": found}


def page(result: dict[str, Any]) -> str:
    """The generated part of the page: the introduction, and a table for each program."""
    lines = textwrap.wrap(INTRODUCTION.format(**result), 118)
    for one in result["programs"]:
        lines += ["", f"## {one['program']} {one['version']}", "", f"Used of it: {one['used']}.", ""]
        lines += ["| Case | Passed | Refused or missing | Deviation | Largest |", "|---|---|---|---|---|"]
        lines += [_line(row) for row in one["cases"]]
    return "\n".join(lines) + "\n"


def _line(row: dict[str, Any]) -> str:
    total = len(row["passed"]) + len(row["wrong"])
    refused = [o for o in row["wrong"] if o["status"] == "refused"]
    names = [f"`{o['output']}`" if o in refused else f"`{o['output']}` (not answered)" for o in row["wrong"]]
    sizes = [o["distance"] for o in refused if o["distance"] is not None]
    largest = f"{max(sizes):.1e}" if sizes else "not finite" if refused else ""
    named = ", ".join(f"`{flag}`" for flag in row["named"]) or ("none of the known mistakes" if refused else "")
    return f"| `{row['case']}` | {len(row['passed'])} of {total} | {', '.join(names) or 'none'} | {named} | {largest} |"


def main(words: list[str]) -> int:
    """Survey, then print or write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--program", default="", choices=["", *(name for name, _, _ in PROGRAMS.values())])
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args(words)
    result = survey(options.python, options.program)
    if not result["programs"]:
        print("no program is installed: pip install gsplat splax torch")
        return 1
    print(page(result))
    if options.write:
        RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        head, mark, rest = PAGE.read_text(encoding="utf-8").partition(START)
        PAGE.write_text(head + mark + "\n" + page(result) + END + rest.partition(END)[2], encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
