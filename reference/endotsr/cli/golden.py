"""`endotsr golden`: the conformance target of ports: judge outputs, run a port, check or rewrite the vectors."""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.errors import InputError
from endotsr.runs.files import refuse_unwritable

Outdir = Annotated[Path, Option("OUTDIR", positional=True)]
Level = Literal[0, 1, 2, 3, 4, 5]


@dataclass
class _Reported:
    precision: Literal["float32", "float64"] = "float32"
    """precision that the port claims"""
    level: Level = 5
    """level to judge; exit code 0 if it is complete"""
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder of the golden cases (default: golden/ of the source tree or of the working folder)"""
    json: Annotated[Path | None, Option("FILE")] = None
    """also write the report as JSON"""
    html: Annotated[Path | None, Option("FILE")] = None
    """also write the report as one HTML page with difference images"""
    only: Annotated[str, Option("FAMILY[/CASE]")] = ""
    """judge this family or case alone; there is then no claim, and exit code 0 means that nothing was refused"""
    all: bool = False
    """list the cases that passed, too"""


@dataclass
class JudgeOptions(_Reported):
    """Judge a folder of outputs OUTDIR/<family>/<case>/<name>.npy; exit code 1 if the level is not complete."""

    outdir: Outdir = Path()
    again: Annotated[Path | None, Option("DIR")] = None
    """outputs of a second run: level 5 requires it, with the same bits"""


@dataclass
class RunOptions(_Reported):
    """Pass all requests to a port's command, then judge its outputs."""

    port: str = ""
    """the command, with {requests} and {outputs} in place of the folders; called without a shell"""
    timeout: float = 600.0
    """seconds allowed for one call"""
    keep: Annotated[Path | None, Option("DIR")] = None
    """keep requests and outputs in this folder, in place of those of an earlier run"""


@dataclass
class GenerateOptions:
    """Recompute all cases and compare with the folder; exit code 1 if anything differs."""

    golden: Annotated[Path | None, Option("DIR")] = None
    """folder of the golden cases"""
    within_tolerance: bool = False
    """accept other bits within the float64 tolerance also on the class of machine that wrote the vectors"""
    json: JsonFile = None
    """also write the differences as JSON"""
    write: bool = False
    """replace the vectors, print which expected values changed, and still end with exit code 1"""


@dataclass
class ReferenceOptions:
    """Write the reference's own outputs; with --requests, as a port that reads the requests alone."""

    outdir: Outdir
    precision: Literal["float32", "float64"] = "float32"
    """precision of the arithmetic; with --requests, the precision of the requests"""
    json: JsonFile = None
    """also write the number of cases as JSON"""
    requests: Annotated[Path | None, Option("DIR")] = None
    """answer this folder of requests"""
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder of the golden cases"""


@dataclass
class WrongPortOptions:
    """Write the outputs of a deliberately wrong port, in float64; without a name, list all mistakes."""

    name: Annotated[str, Option("[FLAG]", positional=True)] = ""
    outdir: Outdir = Path()
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder of the golden cases"""
    json: JsonFile = None
    """also write the mistake, or the list of them, as JSON"""


DOORS = {
    "judge": "judge a folder of outputs",
    "run": "call a port's command and judge its outputs",
    "reference": "write the reference's own outputs in the same form",
    "negative": "write the outputs of a deliberately wrong port",
    "generate": "check the vectors against a fresh computation; --write replaces them",
}


def run(words: list[str]) -> int:
    """The command."""
    if not words or words[0] in ("-h", "--help"):
        width = max(map(len, DOORS))
        print("usage: endotsr golden SUBCOMMAND [OPTIONS]\n")
        print("\n".join(f"  {name:<{width}}  {text}" for name, text in DOORS.items()))
        return 0
    if words[0] not in DOORS:
        raise InputError(f"unknown subcommand golden {words[0]!r}; allowed: {', '.join(DOORS)}")
    return globals()[f"_{words[0]}"](words[1:])


def _judge(words: list[str]) -> int:
    from endotsr.golden.judge.store import golden_folder, read_golden
    from endotsr.golden.judge.verdict import judge

    options = parse(JudgeOptions, words, "golden judge")
    if options.outdir == Path():
        raise InputError("golden judge: OUTDIR is missing")
    for folder in filter(None, (options.outdir, options.again)):
        if not folder.is_dir():
            raise InputError(f"{folder}: not a folder")
    refuse_unwritable(options.json, options.html)
    golden = read_golden(golden_folder(options.golden))
    asked = {"level": options.level, "again": options.again, "only": options.only}
    report = judge(golden, options.outdir, options.precision, **asked)
    return _tell(report, golden, options.outdir, options)


def _run(words: list[str]) -> int:
    from endotsr.golden.judge.command import KEPT, clear_kept, refuse_command, run_port, write_requests
    from endotsr.golden.judge.store import golden_folder, read_golden
    from endotsr.golden.judge.verdict import judge, only_of, without_claim

    options = parse(RunOptions, words, "golden run")
    refuse_command(options.port)
    refuse_unwritable(options.json, options.html)
    golden = read_golden(golden_folder(options.golden))
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)
        requests, *folders = (root / name for name in KEPT)
        clear_kept(root)
        write_requests(only_of(golden, options.only), requests, options.precision, options.level)
        calls = folders if options.level >= 5 else folders[:1]
        notes = [run_port(options.port, requests, folder, options.timeout) for folder in calls]
        again = folders[1] if options.level >= 5 else None
        report = judge(golden, folders[0], options.precision, level=options.level, again=again, only=options.only)
        if any(notes):
            without_claim(report, list(filter(None, notes)))
        return _tell(report, golden, folders[0], options)


def _tell(report, golden, outdir: Path, options: _Reported) -> int:
    from endotsr.golden.judge.report import as_html, as_json, as_table

    print(as_table(report, everything=options.all))
    if options.json:
        options.json.write_bytes(as_json(report))
    if options.html:
        options.html.write_text(as_html(report, golden, outdir), encoding="utf-8")
    accepted = all(case.status in ("passed", "not ported") for case in report.cases) if options.only else report.passed
    return 0 if accepted else 1


def _generate(words: list[str]) -> int:
    from endotsr.golden.judge.store import golden_folder
    from endotsr.golden.vectors.generate import check, write

    options = parse(GenerateOptions, words, "golden generate")
    refuse_unwritable(options.json)
    folder = golden_folder(options.golden)
    if options.write:
        lines = write(folder)
        write_result(options.json, folder=folder, written=True, changes=lines)
        print("\n".join(lines) or "no expected value moved")
        print(f"golden: written, {len(lines)} changes; if values moved, raise {folder / 'VERSION'}", file=sys.stderr)
        return 1
    lines, summary = check(folder, bitwise=not options.within_tolerance)
    write_result(options.json, folder=folder, written=False, changes=lines, summary=summary)
    print("\n".join([*lines, f"golden: {summary}, {len(lines)} differ"]))
    return 1 if lines else 0


def _reference(words: list[str]) -> int:
    from endotsr.golden.judge.store import golden_folder, read_golden
    from endotsr.golden.vectors.reference import answer_all, answer_requests

    options = parse(ReferenceOptions, words, "golden reference")
    refuse_unwritable(options.json)
    if options.requests is not None:
        count = answer_requests(options.requests, options.outdir)
    else:
        count = answer_all(read_golden(golden_folder(options.golden)), options.outdir, options.precision)
    print(f"golden: {count} cases answered in {options.outdir}")
    write_result(options.json, cases=count, folder=options.outdir)
    return 0


def _negative(words: list[str]) -> int:
    from endotsr.golden.judge.store import golden_folder, read_golden
    from endotsr.golden.vectors.reference import answer_wrongly
    from endotsr.golden.vectors.registry import all_wrong_ports

    options = parse(WrongPortOptions, words, "golden negative")
    refuse_unwritable(options.json)
    known = all_wrong_ports()
    if not options.name:
        print("\n".join(f"{w.flag}: {w.title} ({w.wrong})" for w in known.values()))
        write_result(options.json, mistakes={w.flag: {"title": w.title, "wrong": w.wrong} for w in known.values()})
        return 0
    if options.name not in known or options.outdir == Path():
        raise InputError("golden negative: give the FLAG of a mistake (without arguments: a list) and OUTDIR")
    count = answer_wrongly(read_golden(golden_folder(options.golden)), options.outdir, known[options.name])
    print(f"golden: {count} cases answered wrongly in {options.outdir}")
    write_result(options.json, mistake=options.name, cases=count, folder=options.outdir)
    return 0
