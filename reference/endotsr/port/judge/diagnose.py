"""The first wrong operation of a port, described without a list of mistakes.

In: the verdicts on all cases, with the relations of every refused output. Out: lines with the first wrong operation,
its equation and level, its direction, its outputs and cases, and the relations common to all of them.
"""

from collections.abc import Sequence
from typing import Any

from endotsr.port.judge.format import Case

PARTS = {
    "scene": ("frequencies", "dictionary", "atoms", "appearance", "motion", "deformation"),
    "render": ("covariance", "projection", "harmonics", "composite"),
    "objective": ("scene", "render", "exposure", "masked_l1", "masked_ssim", "normalised_depth", "smoothness",
                  "laplacian", "matern"),
    "training": ("objective", "calibration", "adam", "schedule", "density"),
    "determinism": ("objective",),
}  # fmt: skip
"""Operations that an operation is directly composed of, in the order of the method; a part comes before the whole."""
MOST_CASES = 4  # listed by name


def made_of(operation: str) -> set[str]:
    """All operations that an operation is composed of, at any depth."""
    parts = set(PARTS.get(operation, ()))
    return parts.union(*map(made_of, parts))


def order_of(cases: Sequence[Case]) -> list[str]:
    """The operations in the order of the diagnosis: those without parts, and then those composed of others.

    Of those without parts, the parts of others come first, and the rest follows as the cases have it.
    """
    parts = [part for whole in PARTS.values() for part in whole]
    simple = [name for name in (*parts, *(case.operation for case in cases)) if name not in PARTS]
    return list(dict.fromkeys((*simple, *PARTS)))


def diagnosis(cases: Sequence[Case], reports: Sequence[Any]) -> list[str]:
    """Lines on the first operation with a refused output, by level and then in the order of the method; [] = none.

    reports   case reports of the judge, with the relations of their outputs
    """
    known = {case.name: case for case in cases}
    level, first = first_wrong(cases, reports)
    if first is None:
        return []
    mine = [r for r in reports if r.name in known and known[r.name].operation == first.operation and r.outputs]
    refused = [(r, o) for r in mine for o in r.outputs if o.status == "refused"]
    place = f"operation {first.operation}" + (f", equation ({first.equation})" if first.equation else "")
    lines = [f"first wrong: {place}, level {level}, {_direction(mine, refused)}"]
    paths = [r for r in mine if r.first_wrong]
    lines += _along(paths)
    named: dict[str, list[str]] = {}
    for name in dict.fromkeys(o.name for r, o in refused if not (paths and _follows(known[r.name], o.name))):
        forms = [o.forms for _, o in refused if o.name == name]
        shared = [form for form in forms[0] if all(form in other for other in forms)]
        text = "; ".join(shared[:2]) or "; ".join(forms[0][:1]) or "no simple relation to the expected array"
        named.setdefault(text, []).append(name)
    lines += [f"  {', '.join(names)}: {text}" for text, names in named.items()]
    bad = list(dict.fromkeys(r.name for r, _ in refused))
    if 2 * len(bad) <= len(mine):
        titles = "; ".join(f"{name} ({known[name].title})" for name in bad[:MOST_CASES])
        titles += "; and below" * (len(bad) > MOST_CASES)
        outputs = list(dict.fromkeys(o.name for _, o in refused))
        less = len(outputs) < len({o.name for r in mine for o in r.outputs if r.name in bad})
        where = f"; wrong there: {', '.join(outputs)}" if less else ""
        lines.append(f"  only in {len(bad)} of its {len(mine)} cases: {titles}{where}")
    return lines


def _along(paths: Sequence[Any]) -> list[str]:
    """The first wrong iteration of trajectories, and the events common to all of them there."""
    lines = [f"  {r.name}: {r.first_wrong}" for r in paths[:MOST_CASES]]
    lines += [f"  and {len(paths) - MOST_CASES} more cases, see below"] if len(paths) > MOST_CASES else []
    common = [event for event in paths[0].events if all(event in r.events for r in paths)] if len(paths) > 1 else []
    return lines + [f"  in each of these cases {event} this iteration or the one before" for event in common]


def _follows(case: Case, output: str) -> bool:
    """Whether an output belongs to a trajectory, of which the first wrong iteration is said, not the relations."""
    return case.outputs[output].order == "iteration" or output.startswith("final_")


def first_wrong(cases: Sequence[Case], reports: Sequence[Any]) -> tuple[int, Case | None]:
    """The first case with a refused output, by level, then in the order of the method, and that level."""
    known, place = {case.name: case for case in cases}, {name: k for k, name in enumerate(order_of(cases))}
    wrong = [
        (o.level, place[known[r.name].operation], k, r.name)
        for k, r in enumerate(reports)
        for o in r.outputs
        if o.status == "refused" and r.name in known
    ]
    return (min(wrong)[0], known[min(wrong)[-1]]) if wrong else (0, None)


def _direction(mine: Sequence[Any], refused: Sequence[tuple[Any, Any]]) -> str:
    """Forward, reverse or both, or one output alone; others are right if each was compared."""
    names = {o.name for _, o in refused}
    others = [o for r in mine for o in r.outputs if o.name not in names]
    if len(names) == 1 and others:
        right = all(o.status == "passed" for o in others)
        more = "its other outputs are right" if right else "no other output is refused"
        return f"{next(iter(names))} alone; {more}"
    if all(name.startswith("d_") for name in names):
        forward = [o.status for o in others if not o.name.startswith("d_")]
        right = all(status == "passed" for status in forward)
        more = "its forward outputs are right" if right else "no forward output is refused"
        return f"reverse alone; {more}" if forward else "reverse alone"
    return "forward" if not any(name.startswith("d_") for name in names) else "forward and reverse"
