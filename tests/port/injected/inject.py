"""Put single mistakes into ports and count how many the judge names.

    python tests/port/injected/inject.py [PORT ...] [--only FLAG ...] [--json docs/results/injected.json]

PORT is c99, reference or torch; all of them by default. The port in PyTorch is run by the interpreter that
ENDOTSR_TORCH_PYTHON names, by default this one, and is left out where that one has no torch. The mistakes are those
of `mistakes.toml`, and each is made alone. It is named rightly if the first mistake that the report names is this one.
The right ports are judged as well: they must pass, and nothing may be named. The exit status is 0 if at least 15 of 16
are named. The result is a table of docs/guides/port.md, which docs/pages/ports/injected.py writes. In the file, the
outcomes of mistakes that were not made stay as they are if they are of the same version.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.port.judge.case_verdict import judge_case
from endotsr.port.judge.command import run_port, write_requests
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden, golden_folder, in_precision, read_golden
from endotsr.port.judge.verdict import conclude, judge
from endotsr.port.reference import stored
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated

sys.path.insert(0, str(Path(__file__).parents[3] / "golden"))
from makers.copies import Edit, changed_copy
from makers.registry import all_wrong_ports

PORTED = golden_folder() / "ports"


class Mistake(NamedTuple):
    """A mistake that is put into a port."""

    flag: str  # the name that the judge has to give
    edits: tuple[Edit, ...]  # of files of the port; of the reference, of its modules
    operations: tuple[str, ...]  # on which a mistake in the reference is examined


def mistakes(port: str, only: Sequence[str] = ()) -> list[Mistake]:
    """The mistakes that `mistakes.toml` lists for a port, or some of them."""
    table = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))[port]
    return [
        Mistake(flag, tuple(Edit(*change) for change in entry["changes"]), tuple(entry.get("operations", "").split()))
        for flag, entry in table.items()
        if not only or flag in only
    ]


class Outcome(NamedTuple):
    """What the judge said of one mistake."""

    port: str
    flag: str
    named: tuple[str, ...]  # mistakes that the report names, best first
    refused: int  # outputs
    likeliest: str  # the first candidate of the report, named or not; "" = none
    agrees: int  # refused outputs that have the values of that candidate
    differs: int  # refused outputs that it would change otherwise

    @property
    def right(self) -> bool:
        """Whether the first name is that of the mistake."""
        return self.named[:1] == (self.flag,)


def said(port: str, flag: str, report: Report) -> Outcome:
    """The outcome of a report."""
    refused = sum(o.status == "refused" for case in report.cases for o in case.outputs)
    named = tuple(s.flag for s in report.suspects if s.named)
    if not report.suspects:
        return Outcome(port, flag, named, refused, "", 0, 0)
    first = report.suspects[0]
    return Outcome(port, flag, named, refused, first.flag, len(first.evidence.agrees), len(first.evidence.differs))


class CPort:
    """The port in C99, compiled once; a mistake compiles its file again."""

    def __init__(self, folder: Path, golden: Golden) -> None:
        self.folder, self.golden, self.requests = folder, golden, folder / "requests"
        write_requests(golden, self.requests, "float64", 2)
        self.objects = {file.name: self._compiled(file, file.stem) for file in sorted((PORTED / "c99").glob("*.c"))}

    def _compiled(self, file: Path, name: str) -> str:
        target = str(self.folder / f"{name}.o")
        words = ["cc", "-std=c99", "-O0", "-DREAL=double", "-I", str(PORTED / "c99"), "-c", str(file), "-o", target]
        subprocess.run(words, check=True)
        return target

    def report(self, mistake: Mistake | None) -> Report:
        """The judge's report on the port with a mistake, or on the right one."""
        objects = dict(self.objects)
        if mistake:
            file = self.folder / "wrong.c"
            file.write_text(changed("c99", mistake))
            objects[mistake.edits[0].module] = self._compiled(file, "wrong")
        subprocess.run(["cc", *objects.values(), "-lm", "-o", str(self.folder / "port")], check=True)
        outputs = self.folder / "outputs"
        shutil.rmtree(outputs, ignore_errors=True)
        run_port(f"{self.folder / 'port'} {{requests}} {{outputs}}", self.requests, outputs, 60)
        return judge(self.golden, outputs, "float64", level=2)


def changed(port: str, mistake: Mistake) -> str:
    """The file with the mistake. Raises ValueError where an old text does not occur exactly once."""
    text = (PORTED / port / mistake.edits[0].module).read_text(encoding="utf-8")
    for edit in mistake.edits:
        if text.count(edit.old) != 1 or edit.module != mistake.edits[0].module:
            raise ValueError(f"{mistake.flag}: {edit.old!r} occurs {text.count(edit.old)} times in {edit.module}")
        text = text.replace(edit.old, edit.new)
    return text


def in_c(golden: Golden, only: Sequence[str]) -> Iterator[Outcome]:
    """The mistakes in the port in C99, one by one, and first the right port."""
    with tempfile.TemporaryDirectory() as scratch:
        port = CPort(Path(scratch), golden)
        yield said("c99", "", port.report(None))
        for mistake in mistakes("c99", only):
            yield said("c99", mistake.flag, port.report(mistake))


def in_copies(golden: Golden, only: Sequence[str]) -> Iterator[Outcome]:
    """The mistakes in the reference: a case that the mistake is not examined on is taken as passed."""
    for mistake in mistakes("reference", only):
        with tempfile.TemporaryDirectory() as scratch:
            folder, verdicts = Path(scratch), []
            with changed_copy(mistake.edits) as operation, np.errstate(all="ignore"):
                for case in golden.cases:
                    if case.operation not in mistake.operations:
                        continue
                    inputs = in_precision(golden.inputs(case), "float32")
                    found = operation(case.operation).compute(inputs, dict(case.settings) | {"_compositor": "blocks"})
                    for name in set(case.outputs) & set(found):
                        write_npy(folder / case.name / f"{name}.npy", stored(found[name]))
            verdicts = [judge_case(golden, c, folder, "float32") for c in golden.cases if (folder / c.name).is_dir()]
            yield said("reference", mistake.flag, conclude(golden, verdicts, "float32", 4, []))


def in_torch(golden: Golden, only: Sequence[str]) -> Iterator[Outcome]:
    """The mistakes in the port in PyTorch, on the operations on which they are known; first the right one on all."""
    python = os.environ.get("ENDOTSR_TORCH_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import torch"], capture_output=True, check=False).returncode:
        print("torch: no PyTorch here, this port is left out")
        return
    known, wrong = all_wrong_ports(), mistakes("torch", only)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write_requests(golden, folder / "requests", "float64", 3)
        right = (PORTED / "torch" / "port.py").read_text(encoding="utf-8")
        jobs = [{"source": right, "operations": [case.operation for case in golden.cases]}]
        jobs += [{"source": changed("torch", m), "operations": _first_two(known[m.flag].operations)} for m in wrong]
        (folder / "jobs.json").write_text(json.dumps(jobs))
        driver = str(Path(__file__).with_name("torch_driver.py"))
        subprocess.run([python, driver, str(folder / "jobs.json"), *(str(folder / n) for n in ("requests", "outputs"))],
                       check=True)  # fmt: skip
        for k, flag in enumerate(["", *(m.flag for m in wrong)]):
            answered = folder / "outputs" / str(k)
            cases = [case for case in golden.cases if (answered / case.name).is_dir()]
            verdicts = [judge_case(golden, case, answered, "float64") for case in cases]
            yield said("torch", flag, conclude(golden, verdicts, "float64", 3, []))


def _first_two(operations: tuple[str, ...]) -> list[str]:
    """The operation itself and one more: the whole objective is not ported."""
    return [name for name in operations if name not in ("objective", "training")][:2]


PORTS: dict[str, Callable[[Golden, Sequence[str]], Iterator[Outcome]]] = {
    "c99": in_c,
    "reference": in_copies,
    "torch": in_torch,
}


def keep(file: Path, version: str, outcomes: list[Outcome]) -> None:
    """Write the outcomes in the place of those of the same mistakes, or in the place of all of another version."""
    before = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    old = before["outcomes"] if before.get("golden") == version else []
    rows = {(row["port"], row["flag"]): row for row in [*old, *(outcome._asdict() for outcome in outcomes)]}
    write_json(file, dated({"golden": version, "outcomes": list(rows.values())}))


def main(words: list[str]) -> int:
    """Run, print a line for each mistake that is not named first, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ports", nargs="*", metavar="PORT", choices=[*PORTS, "all"], default="all")
    parser.add_argument("--only", nargs="+", metavar="FLAG", default=())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(words)
    golden, outcomes = read_golden(golden_folder()), []
    for name in PORTS if options.ports == "all" else options.ports:
        for outcome in PORTS[name](golden, options.only):
            outcomes.append(outcome)
            if outcome.flag == "":
                print(f"{name}: the right port: {outcome.refused} outputs refused, named: {outcome.named or 'none'}")
            elif not outcome.right:
                named = ", ".join(outcome.named[:3]) or f"none; {outcome.likeliest or 'none'} comes first"
                print(f"{name}: {outcome.flag}: {outcome.refused} outputs refused, named: {named}", flush=True)
    wrong = [outcome for outcome in outcomes if outcome.flag]
    right = sum(outcome.right for outcome in wrong)
    print(f"{right} of {len(wrong)} single mistakes named rightly")
    if options.json:
        keep(options.json, golden.manifest.version, outcomes)
    clean = all(not outcome.refused and not outcome.named for outcome in outcomes if not outcome.flag)
    return 0 if clean and 16 * right >= 15 * len(wrong) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
