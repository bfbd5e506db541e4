"""`endotsr golden`: conformance tests for ports: judge outputs, run a port, write the reference's outputs."""

import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import HELP, parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.errors import InputError
from endotsr.untrusted.names import choice, counted

Outdir = Annotated[Path, Option("OUTDIR", positional=True)]
Level = Literal[0, 1, 2, 3, 4, 5]
Profile = Literal["", "renderer-forward", "renderer", "losses", "optimiser", "method", "training"]


@dataclass
class _Reported:
    precision: Literal["float32", "float64"] = "float32"
    """claimed precision of the port"""
    level: Level = 5
    """level to judge; exit code 0 if it is complete"""
    profile: Profile = ""
    """judge this part of the method only; the level is then at most its last one"""
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder or archive of the golden cases (default: golden/ or archive at hand)"""
    json: JsonFile = None
    """also write the report as JSON"""
    html: Annotated[Path | None, Option("FILE", written=True)] = None
    """also write the report as one HTML page with difference images"""
    only: Annotated[str, Option("FAMILY[/CASE]")] = ""
    """judge this family or case only; the report then makes no claim, and exit code 0 means that no case failed"""
    all: bool = False
    """list all cases, including those that passed"""
    search: Annotated[float, Option("SECONDS")] = 16.0
    """time limit of the search for the cause of a failure, seconds of computation; 0 = no search"""


@dataclass
class JudgeOptions(_Reported):
    """Judge a folder of outputs OUTDIR/<family>/<case>/<name>.npy; exit code 1 if the level is not complete."""

    outdir: Annotated[Path | None, Option("OUTDIR", positional=True)] = None
    again: Annotated[Path | None, Option("DIR")] = None
    """outputs of a second run; level 5 requires them to be bitwise equal"""


@dataclass
class RunOptions(_Reported):
    """Pass all requests to a port's command, then judge its outputs."""

    port: str = ""
    """the command, with {requests} and {outputs} for the folders; called without a shell"""
    runs: int = 1
    """call the port so many times; a level is complete if each run is within tolerance (level 4 at most)"""
    timeout: float = 600.0
    """time limit of a call, seconds"""
    keep: Annotated[Path | None, Option("DIR")] = None
    """keep requests and outputs in this folder; replaces those of an earlier run"""
    certificate: Annotated[Path | None, Option("FILE", written=True)] = None
    """write a certificate if the level is complete"""
    badge: Annotated[Path | None, Option("FILE", written=True)] = None
    """write the badge of the certificate as SVG"""
    name: str = ""
    """name of the port in the certificate (default: the working folder)"""


@dataclass
class VerifyOptions:
    """Judge a port again and compare with its certificate; exit code 1 if the certificate is not confirmed."""

    certificate: Annotated[Path, Option("CERTIFICATE", positional=True)] = Path()
    port: str = ""
    """the command of the port; that of the certificate is shown and not run"""
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder or archive of the golden cases (default: golden/ or archive at hand)"""
    json: JsonFile = None
    """also write the outcome as JSON"""
    timeout: float = 600.0
    """time limit of a call, seconds"""


@dataclass
class ReferenceOptions:
    """Write the reference's outputs; with --requests, computed from the requests only, like a port."""

    outdir: Outdir
    precision: Literal["float32", "float64"] = "float32"
    """precision of the arithmetic; with --requests, the precision of the requests"""
    json: JsonFile = None
    """also write the number of cases as JSON"""
    requests: Annotated[Path | None, Option("DIR")] = None
    """folder of requests to answer"""
    golden: Annotated[Path | None, Option("DIR")] = None
    """folder of the golden cases"""


SUBCOMMANDS = {
    "judge": "judge a folder of outputs",
    "run": "call a port's command and judge its outputs",
    "verify": "judge a port again and compare with its certificate",
    "reference": "write the reference's outputs in the same format",
}


def run(words: list[str]) -> int:
    """The command."""
    if not words or words[0] in HELP:
        width = max(map(len, SUBCOMMANDS))
        print("usage: endotsr golden SUBCOMMAND [OPTIONS]\n")
        print("\n".join(f"  {name:<{width}}  {text}" for name, text in SUBCOMMANDS.items()))
        print("\n`endotsr golden SUBCOMMAND --help` lists the options of a subcommand.")
        return 0
    if words[0] not in SUBCOMMANDS:
        raise InputError(f"unknown subcommand golden {words[0]!r}; use {choice(SUBCOMMANDS)}")
    return globals()[f"_{words[0]}"](words[1:])


def _judge(words: list[str]) -> int:
    from endotsr.port.judge.command import refuse_folders
    from endotsr.port.judge.store import golden_folder, read_golden
    from endotsr.port.judge.verdict import judge

    options = parse(JudgeOptions, words, "golden judge")
    if options.outdir is None:
        raise InputError("golden judge: OUTDIR is missing")
    refuse_folders(options.outdir, options.again, options.level, options.profile)
    golden = read_golden(golden_folder(options.golden))
    asked = {"level": options.level, "again": options.again, "only": options.only, "profile": options.profile}
    report = judge(golden, options.outdir, options.precision, **asked)
    return _report(report, golden, options.outdir, options)


def _run(words: list[str]) -> int:
    from endotsr.port.judge.badge import write_proof
    from endotsr.port.judge.call import called
    from endotsr.port.judge.certificate import port_of
    from endotsr.port.judge.runs import called_often
    from endotsr.port.judge.store import golden_folder, read_golden

    options = parse(RunOptions, words, "golden run")
    golden = read_golden(golden_folder(options.golden))
    with tempfile.TemporaryDirectory() as scratch:
        asked = {"level": options.level, "only": options.only, "timeout": options.timeout, "profile": options.profile}
        call = called if options.runs == 1 else partial(called_often, runs=options.runs)
        report, outputs = call(golden, options.port, options.keep or Path(scratch), options.precision, **asked)
        code = _report(report, golden, outputs, options)
    if options.certificate or options.badge:
        reason = write_proof(golden, report, port_of(options.port, options.name), options.certificate, options.badge)
        print(reason, end="\n" if reason else "")
        code = code or int(bool(reason))
    return code


def _verify(words: list[str]) -> int:
    from endotsr.port.judge.certificate import read_certificate
    from endotsr.port.judge.report import as_table
    from endotsr.port.judge.store import golden_folder, read_golden
    from endotsr.port.judge.verify import summary, verified

    options = parse(VerifyOptions, words, "golden verify")
    if options.certificate == Path():
        raise InputError("golden verify: CERTIFICATE is missing")
    given, golden = read_certificate(options.certificate), read_golden(golden_folder(options.golden))
    with tempfile.TemporaryDirectory() as scratch:
        report, _, found = verified(golden, given, options.port, Path(scratch), timeout=options.timeout)
    print("\n".join([*([as_table(report)] if found else []), *summary(given, options.port, found)]))
    write_result(options.json, certificate=options.certificate, confirmed=not found, differences=found)
    return 1 if found else 0


def _report(report, golden, outdir: Path, options: _Reported) -> int:
    from endotsr.port.judge.report import as_table, write_report

    if report.first_wrong and options.search > 0:
        from endotsr.port.search.find import explain

        explain(golden, report, outdir, options.search)
    print(as_table(report, everything=options.all))
    write_report(report, golden, outdir, options.json, options.html)
    return 0 if (report.accepted if options.only else report.passed) else 1


def _reference(words: list[str]) -> int:
    from endotsr.port.judge.store import golden_folder, read_golden
    from endotsr.port.reference import answer_all, answer_requests

    options = parse(ReferenceOptions, words, "golden reference")
    if options.requests is not None:
        count = answer_requests(options.requests, options.outdir)
    else:
        count = answer_all(read_golden(golden_folder(options.golden)), options.outdir, options.precision)
    print(f"golden: {counted(count, 'case')} answered in {options.outdir}")
    write_result(options.json, cases=count, folder=options.outdir)
    return 0
