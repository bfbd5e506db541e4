"""Verification of a certificate: the judgement again, and every difference from the claim of the certificate.

A certificate is a file of another person, so its command is shown and never run: the caller gives the command. Another
commit, command or version of the judge is said, and is no difference.
"""

from functools import partial
from pathlib import Path

from endotsr import __version__
from endotsr.errors import InputError
from endotsr.port.judge.call import called
from endotsr.port.judge.certificate import Certificate, certified, manifest_hash, port_of
from endotsr.port.judge.records import Report
from endotsr.port.judge.runs import called_often
from endotsr.port.judge.store import Golden

COMPARED = (
    "claim",
    "vectors",
    "manifest",
    "profile",
    "level",
    "precision",
    "without",
    "right",
    "cases",
    "outputs",
    "runs",
)


def same_vectors(golden: Golden, given: Certificate) -> None:
    """Raises InputError if the vectors at hand are not those of the certificate."""
    if (golden.manifest.version, manifest_hash(golden)) != (given.vectors, given.manifest):
        raise InputError(
            f"verify: the certificate is of vectors {given.vectors} with manifest {given.manifest[:12]}, at hand are "
            f"{golden.manifest.version} with {manifest_hash(golden)[:12]}; name those of the certificate with --golden"
        )


def verified(
    golden: Golden, given: Certificate, command: str, root: Path, *, timeout: float = 600.0
) -> tuple[Report, Path, list[str]]:
    """Judge the port again as the certificate says. Returns the report, its outputs and the differences, one a line.

    command   of the port, with {requests} and {outputs}
    root      folder for requests and outputs

    Raises: InputError without a command, with the one of the certificate in the message, and for other vectors.
    """
    if not command:
        raise InputError(
            "verify: a command out of a file is not run; read it and give it yourself, in the folder of the port: "
            f"--port {given.port.command!r}"
        )
    same_vectors(golden, given)
    asked = {"level": given.level, "profile": given.profile, "timeout": timeout}
    call = called if given.runs == 1 else partial(called_often, runs=given.runs)
    report, outputs = call(golden, command, root, given.precision, **asked)
    return report, outputs, differences(golden, given, report, command)


def differences(golden: Golden, given: Certificate, report: Report, command: str) -> list[str]:
    """What the certificate says and the judgement does not confirm; of a port that fails, the claim alone."""
    if not report.passed:
        return [f"claim: the certificate says {given.claim!r}, the judge {report.claim!r}"]
    now = certified(golden, report, port_of(command))
    pairs = [(name, getattr(given, name), getattr(now, name)) for name in COMPARED]
    limits = ("smallest", "largest")
    pairs += [(f"tolerances.{one}", getattr(given.tolerances, one), getattr(now.tolerances, one)) for one in limits]
    return [f"{name}: the certificate says {said!r}, the judge {one!r}" for name, said, one in pairs if said != one]


def summary(given: Certificate, command: str, found: list[str]) -> list[str]:
    """The result for a terminal; another commit, command or judge is named, but is no difference of the claim."""
    now, notes = port_of(command), []
    if given.port.commit != now.commit:
        notes.append(f"commit: {given.port.commit or 'none'} in the certificate, {now.commit or 'none'} here")
    if given.port.command != command:
        notes.append(f"command: {given.port.command!r} in the certificate")
    if given.judge != __version__:
        notes.append(f"judge: endotsr {given.judge} in the certificate, {__version__} here")
    result = "differs from the certificate" if found else f"confirmed: {given.claim}"
    return [*found, *notes, result]
