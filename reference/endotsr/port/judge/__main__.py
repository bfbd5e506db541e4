"""The judge as a program of its own: `python endotsr-golden.pyz run ...`. It needs NumPy and no other library.

It has no search for the line of the definition that a port computes: `endotsr golden` of the package has.
"""

import argparse
import os
import signal
import sys
import tempfile
from pathlib import Path

from endotsr.errors import InputError
from endotsr.port.judge.badge import write_proof
from endotsr.port.judge.call import called
from endotsr.port.judge.certificate import NAMED, port_of, read_certificate
from endotsr.port.judge.command import refuse_folders
from endotsr.port.judge.format import LEVELS
from endotsr.port.judge.profiles import PROFILES
from endotsr.port.judge.records import Report
from endotsr.port.judge.report import as_table, write_report
from endotsr.port.judge.runs import called_often
from endotsr.port.judge.store import Golden, golden_folder, read_golden
from endotsr.port.judge.verdict import judge
from endotsr.port.judge.verify import summary, verified

NO_SEARCH = "the line of the definition that your port computes is searched by `endotsr golden` of the package endotsr"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="endotsr-golden", description="Judge a port of the method.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="call a port's command and judge its outputs")
    run.add_argument("--port", required=True, help="the command, with {requests} and {outputs} for the folders")
    run.add_argument("--certificate", type=Path, metavar="FILE", help="write a certificate if the level is complete")
    run.add_argument("--badge", type=Path, metavar="FILE", help="write its badge as SVG")
    run.add_argument("--name", default="", help="name of the port in the certificate; default: the working folder")
    check = commands.add_parser("verify", help="judge again, and compare with a certificate")
    check.add_argument("file", type=Path, metavar="CERTIFICATE")
    check.add_argument("--port", default="", help="the command; that of the certificate is shown and not run")
    check.add_argument("--golden", type=Path, metavar="DIR", help="folder or archive of the vectors")
    for command in (run, check):
        command.add_argument("--timeout", type=float, default=600.0, help="time limit of a call, seconds")
    run.add_argument("--runs", type=int, default=1, help="so many calls, each within tolerance (level 4 at most)")
    run.add_argument("--keep", type=Path, metavar="DIR", help="keep requests and outputs in this folder")
    judged = commands.add_parser("judge", help="judge a folder of outputs")
    judged.add_argument("outdir", type=Path, metavar="OUTDIR")
    judged.add_argument("--again", type=Path, metavar="DIR", help="outputs of a second run, for level 5")
    for command in (run, judged):
        command.add_argument("--precision", choices=("float32", "float64"), default="float32")
        command.add_argument("--level", type=int, choices=tuple(LEVELS), default=5)
        command.add_argument("--profile", default="", choices=("", *PROFILES), help="judge this part of the method")
        command.add_argument("--golden", type=Path, metavar="DIR", help="folder or archive of the vectors")
        command.add_argument("--only", default="", metavar="FAMILY[/CASE]", help="this part alone, without a claim")
        command.add_argument("--json", type=Path, metavar="FILE", help="also write the report as JSON")
        command.add_argument("--html", type=Path, metavar="FILE", help="also write the report as one page")
        command.add_argument("--all", action="store_true", help="list all cases")
    return parser


def _judged(golden: Golden, options: argparse.Namespace, scratch: Path) -> tuple[Report, Path]:
    asked = {"level": options.level, "only": options.only, "profile": options.profile}
    if options.command == "run":
        root = options.keep or scratch
        asked["timeout"] = options.timeout
        if options.runs != 1:
            return called_often(golden, options.port, root, options.precision, runs=options.runs, **asked)
        return called(golden, options.port, root, options.precision, **asked)
    refuse_folders(options.outdir, options.again, options.level, options.profile)
    return judge(golden, options.outdir, options.precision, again=options.again, **asked), options.outdir


def _verified(golden: Golden, options: argparse.Namespace, scratch: Path) -> int:
    given = read_certificate(options.file)
    report, _, found = verified(golden, given, options.port, scratch, timeout=options.timeout)
    print("\n".join([*([as_table(report)] if found else []), *summary(given, options.port, found)]))
    return 1 if found else 0


def _refuse_unwritable(options: argparse.Namespace) -> None:
    """Raise InputError before the port runs if a file cannot be written afterwards."""
    for name in ("json", "html", "certificate", "badge"):
        file = getattr(options, name, None)
        if file and (file.is_dir() or not os.access(file if file.exists() else file.parent, os.W_OK)):
            raise InputError(f"--{name} {file}: cannot be written; use a file in a folder that exists")


def main(words: list[str]) -> int:
    """The command: exit code 0 if the level is complete, 1 if it is not, 2 if it cannot be judged."""
    options = _parser().parse_args(words)
    try:
        _refuse_unwritable(options)
        if options.command == "run" and options.name and options.certificate is None:
            raise InputError(f"--name has no effect without --certificate: {NAMED}; add it, or omit --name")
        golden = read_golden(golden_folder(options.golden))
        with tempfile.TemporaryDirectory() as scratch:
            if options.command == "verify":
                return _verified(golden, options, Path(scratch))
            report, outputs = _judged(golden, options, Path(scratch))
            if report.first_wrong:
                report.notes.append(NO_SEARCH)
            print(as_table(report, everything=options.all))
            write_report(report, golden, outputs, options.json, options.html)
            if options.command == "run" and (options.certificate or options.badge):
                port = port_of(options.port, options.name)
                if reason := write_proof(golden, report, port, options.certificate, options.badge):
                    print(reason)
                    return 1
    except (InputError, OSError) as error:
        print(f"endotsr-golden: error: {error}", file=sys.stderr)
        return 2
    return 0 if (report.accepted if options.only else report.passed) else 1


if __name__ == "__main__":
    if hasattr(signal, "SIGPIPE"):  # the end of `... | head`, in place of an error; Windows has none
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    sys.exit(main(sys.argv[1:]))
