"""A certificate: what a port may claim, of which vectors, by which judge and command, on which machine and day.

In: a report with a complete level. Out: a record for a file of JSON; a file of another person is checked as it is read.
"""

import datetime
import hashlib
import os
import platform
import shutil
import subprocess
import unicodedata
from pathlib import Path
from typing import Literal

import msgspec

from endotsr import __version__
from endotsr.errors import INVISIBLE, InputError
from endotsr.port.judge.format import MOST_RUNS, Level, Precision, _Strict, read_struct, to_json
from endotsr.port.judge.profiles import PROFILES, WITHOUT, ProfileClaim, claim_text
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden
from endotsr.untrusted.names import choice
from endotsr.untrusted.writing import replace_text

LONGEST = 500  # characters of a text
MOST_OPERATIONS = 100
SECONDS = 5.0  # for git
NAMED = "it is the name of the port in the certificate"


class Port(_Strict, frozen=True, kw_only=True):
    """The program that was judged."""

    name: str
    command: str
    """with {requests} and {outputs}; run in the folder of the port"""
    commit: str = ""
    """of its repository, "" if it is in none; with +changes if a file differed from the commit"""


class Machine(_Strict, frozen=True, kw_only=True):
    """Where it ran."""

    processor: str
    cores: int
    system: str


class Tolerances(_Strict, frozen=True, kw_only=True):
    """Those of the case files in this precision, in units of the scale of an output."""

    smallest: float
    largest: float
    used: float
    """largest distance of an output, in its own tolerance"""


class Certificate(_Strict, frozen=True, kw_only=True):
    """A file that `golden run --certificate` writes."""

    format: Literal[1] = 1
    claim: str
    vectors: str
    """version of the vectors"""
    manifest: str
    """SHA-256 of their manifest.json"""
    judge: str
    """version of endotsr"""
    profile: str
    """as for --profile; "" = every operation that the port does not leave out"""
    level: Level
    precision: Precision
    without: tuple[str, ...]
    """what the claim leaves out: operations, or reverse passes"""
    right: tuple[ProfileClaim, ...]
    """what is right, by profile"""
    tolerances: Tolerances
    cases: int
    outputs: int
    """judged, all of them right"""
    port: Port
    machine: Machine
    date: str
    """UTC, ISO 8601"""
    seconds: float
    """of the calls of the port"""
    runs: int = 1
    """with --runs, the number of runs, in each of which the level is complete"""

    def __post_init__(self) -> None:
        texts = [self.claim, self.vectors, self.manifest, self.judge, self.date, *self.without]
        texts += [one.right for one in self.right]
        texts += [self.port.name, self.port.command, self.port.commit, self.machine.processor, self.machine.system]
        for text in texts:
            if len(text) > LONGEST or any(unicodedata.category(letter) in INVISIBLE for letter in text):
                raise InputError(f"a text is longer than {LONGEST} characters or has control characters")
        if (self.profile and self.profile not in PROFILES) or any(one.profile not in PROFILES for one in self.right):
            raise InputError(f"profile: unknown; use {choice(PROFILES)}")
        if len(self.without) > MOST_OPERATIONS or min(self.cases, self.outputs, self.machine.cores) < 1:
            raise InputError(
                f"without, cases, outputs, cores: more than {MOST_OPERATIONS} operations, or a count below 1"
            )
        if not 1 <= self.runs <= MOST_RUNS:
            raise InputError(f"runs: {self.runs}; use 1 to {MOST_RUNS}")
        if not (0 <= self.seconds < 1e9 and 0 <= self.tolerances.used <= 1):
            raise InputError("seconds, tolerances.used: not a time, or an output beyond its tolerance")
        _date(self.date)


def _date(text: str) -> datetime.datetime:
    """The date of a certificate. Raises: InputError."""
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise InputError("date: not a date of ISO 8601") from None
    if found.tzinfo is None:
        raise InputError("date: has no time zone")
    return found


def certified(golden: Golden, report: Report, port: Port) -> Certificate:
    """The certificate of a report. Raises: InputError if `obstacle` has a reason."""
    if reason := obstacle(report):
        raise InputError(reason)
    missing = filter(None, report.claim.partition(WITHOUT)[2].split(", "))
    judged = [o for case in report.cases for o in case.outputs if o.status == "passed" and o.level <= report.level]
    cases = [case for case in report.cases if case.operation and case.status == "passed"]
    return Certificate(
        claim=report.claim, vectors=golden.manifest.version, manifest=manifest_hash(golden), judge=__version__,
        profile=report.profile, level=report.level, precision=report.precision,  # type: ignore[arg-type]
        without=tuple(missing), right=tuple(report.profiles), tolerances=_tolerances(golden, report),
        cases=len(cases), outputs=len(judged), port=port, machine=this_machine(),
        date=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"), seconds=round(report.seconds, 2),
        runs=report.runs,
    )  # fmt: skip


def obstacle(report: Report) -> str:
    """The reason why a report has no certificate, "" if it has one."""
    if report.claim.startswith("no "):
        return f"no certificate: {report.claim}"
    return "" if report.passed else f"no certificate: level {report.asked_level} is not complete; {report.claim}"


def manifest_hash(golden: Golden) -> str:
    """SHA-256 of the manifest, which has the SHA-256 of every file of the cases and schemas."""
    return hashlib.sha256((golden.folder / "manifest.json").read_bytes()).hexdigest()


def _tolerances(golden: Golden, report: Report) -> Tolerances:
    cases = {case.name: case for case in golden.cases}
    found, used = [], 0.0
    for case in report.cases:
        for output in case.outputs if case.name in cases else ():
            tolerance = getattr(cases[case.name].outputs[output.name].compare, report.precision)
            if tolerance and output.status == "passed":
                found.append(tolerance)
                used = max(used, min((output.distance or 0.0) / tolerance, 1.0))
    return Tolerances(smallest=min(found, default=0.0), largest=max(found, default=0.0), used=used)


def this_machine() -> Machine:
    """Processor, cores and system."""
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        processor = next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), processor)
    except OSError:
        pass  # not Linux
    system = f"{platform.system()} {platform.release()}"
    return Machine(processor=_shortened(processor), cores=os.cpu_count() or 1, system=_shortened(system))


def commit_of(folder: Path) -> str:
    """The commit of the repository of a folder; with +changes if a followed file differs; "" without git."""
    git = shutil.which("git")
    if git is None:
        return ""

    def said(*words: str) -> str | None:
        try:
            done = subprocess.run([git, "-C", str(folder), *words], capture_output=True, timeout=SECONDS, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.decode(errors="replace").strip() if done.returncode == 0 else None

    commit = said("rev-parse", "HEAD")
    changed = commit and said("status", "--porcelain", "--untracked-files=no")
    return f"{commit}+changes" if changed else commit or ""


def port_of(command: str, name: str = "") -> Port:
    """The port of a command in the working folder. Raises: InputError if name or command is too long."""
    for text in (name, command):
        if len(text) > LONGEST:
            raise InputError(f"--name, --port: longer than {LONGEST} characters")
    return Port(name=name or Path.cwd().name, command=command, commit=_shortened(commit_of(Path())))


def _shortened(text: str) -> str:
    return "".join(letter for letter in text if unicodedata.category(letter) not in INVISIBLE)[:LONGEST]


def write_certificate(path: Path, certificate: Certificate) -> None:
    """As JSON."""
    replace_text(path, to_json(certificate))


def read_certificate(path: Path) -> Certificate:
    """A certificate, whose claim is that of its numbers. Raises: InputError with the reason for any other file."""
    try:
        found = read_struct(path, Certificate)
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{path}: no certificate: {error}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    wanted = claim_text(found.vectors, found.profile, found.level, found.precision, found.without)
    if found.claim != wanted:
        raise InputError(f"{path}: claim: {found.claim!r} is not that of its level and profile, {wanted!r}")
    return found
