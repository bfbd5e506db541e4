"""A later run of what survived an earlier one, added to its report."""

import json
from typing import Any

from mutation.equivalents import reasons


def survivors(result: dict[str, Any]) -> set[str]:
    """Names of the mutants that no suite noticed and that are not listed as equivalent."""
    found = {name: row for mutants in result["kernels"].values() for name, row in mutants.items()}
    return {name for name, (_, killed, _) in found.items() if max(killed) < 0} - reasons().keys()


def added(before: dict[str, Any], later: dict[str, Any]) -> dict[str, Any]:
    """The first run with what a later one, of the same kernels and newer tests, noticed; checks keep their numbers."""
    names = [*before["checks"], *(n for n in later["checks"] if n not in before["checks"])]
    place = {k: names.index(name) for k, name in enumerate(later["checks"])}
    merged = json.loads(json.dumps(before)) | {"checks": names}
    for kernel, mutants in later["kernels"].items():
        for name, (kind, killed, change) in mutants.items():
            merged["kernels"][kernel][name] = [kind, [place.get(k, k) for k in killed], change]
    again = {key: later["run"][key] for key in ("commit", "finished", "seconds")}
    merged["run"]["again"] = [*before["run"].get("again", []), again]
    return merged | {"false_alarms": sorted({*before["false_alarms"], *later["false_alarms"]})}
