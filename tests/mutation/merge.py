"""Adds a later run on the survivors of an earlier one to its report."""

import json
from collections.abc import Collection
from typing import Any

from mutation.equivalents import reasons
from mutation.mutator import mutants
from mutation.registry import defect_mutants


def names(result: dict[str, Any]) -> set[str]:
    """Every mutant and defect of a report."""
    return {name for found in result["kernels"].values() for name in found} | result["defects"].keys()


def survivors(result: dict[str, Any]) -> set[str]:
    """Names of the mutants that no suite detected and that are not listed as equivalent."""
    found = {name: row for mutants in result["kernels"].values() for name, row in mutants.items()}
    return {name for name, (_, killed, _) in found.items() if max(killed) < 0} - reasons().keys()


def of_today(result: dict[str, Any], functions: dict[str, Any]) -> dict[str, Any]:
    """The report without the mutants and defects that today's source no longer has."""
    kernels = {}
    for kernel, found in result["kernels"].items():
        if kernel in functions:
            today = {m.name for m in mutants(kernel, functions[kernel])}
            kernels[kernel] = {name: row for name, row in found.items() if name in today}
    planted = {d.name for d in defect_mutants(functions)}
    return result | {"kernels": kernels, "defects": {n: r for n, r in result["defects"].items() if n in planted}}


def still_checked(result: dict[str, Any], today: Collection[str]) -> dict[str, Any]:
    """The report without the mutants and defects that a check which is gone has detected; numbers of checks stay.

    today   names of today's checks
    """
    gone = {k for k, name in enumerate(result["checks"]) if name not in today}
    kept = lambda found: {name: row for name, row in found.items() if gone.isdisjoint(row[1])}
    return result | {
        "kernels": {kernel: kept(found) for kernel, found in result["kernels"].items()},
        "defects": kept(result["defects"]),
    }


def whole(result: dict[str, Any], functions: dict[str, Any]) -> bool:
    """True when no mutant of today's source is missing from the report."""
    return names(result) >= {m.name for kernel, function in functions.items() for m in mutants(kernel, function)}


def added(before: dict[str, Any], later: dict[str, Any]) -> dict[str, Any]:
    """The first run with the detections of a later one, of the same kernels and newer tests; numbers of checks stay."""
    checks = [*before["checks"], *(n for n in later["checks"] if n not in before["checks"])]
    place = {k: checks.index(name) for k, name in enumerate(later["checks"])}
    numbers = lambda killed: [place.get(k, k) for k in killed]
    merged = json.loads(json.dumps(before)) | {"checks": checks}
    for kernel, found in later["kernels"].items():
        for name, (kind, killed, change) in found.items():
            merged["kernels"].setdefault(kernel, {})[name] = [kind, numbers(killed), change]
    for name, (kernel, killed) in later["defects"].items():
        merged["defects"][name] = [kernel, numbers(killed)]
    again = {key: later["run"][key] for key in ("commit", "finished", "seconds")}
    merged["run"]["again"] = [*before["run"].get("again", []), again]
    return merged | {"false_alarms": sorted({*before["false_alarms"], *later["false_alarms"]})}
