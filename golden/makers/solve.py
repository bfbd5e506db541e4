"""From a case without answers to its expected outputs, tolerances and mistakes."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.method.splatting.render import Compositor
from endotsr.port.judge.compare import distances, fingerprint, largest, misses
from endotsr.port.judge.format import FLIP_BUDGET, Array, Because, Case, Mistake, Output, Rule, Shown, Truth
from endotsr.port.judge.words import signs
from endotsr.port.operations.operation import Inputs, Operation, Outputs
from endotsr.port.reference import reference, stored
from makers.making import Spec
from makers.operations import Judged
from makers.registry import JUDGED
from makers.wrong import Wrong

MARGIN = 10.0  # smallest size of a detected mistake, in tolerances
SAFETY = {"float64": 64.0, "float32": 16.0}  # tolerance over measured spread
FLOOR = {"float64": 1e-12, "float32": 4e-6}
STEP = {"float64": 2.0**-52, "float32": 2.0**-23}
FLIP_STEP = 1e-5  # relative change of the cutoff that may flip a pixel on it


class Solved(NamedTuple):
    """A case with its answers."""

    case: Case
    inputs: dict[str, NDArray]
    expected: tuple[Outputs, ...]  # one per legal answer

    def files(self) -> list[tuple[str, str, NDArray]]:
        """(output, path within the case, array) of every expected array."""
        found = [(n, o.file, self.expected[0][n]) for n, o in self.case.outputs.items()]
        for number, other in enumerate(self.expected[1:], start=1):
            found += [(n, o.answer(number), other[n]) for n, o in self.case.outputs.items() if o.compare.others]
        return found


def kind_of(array: NDArray) -> str:
    """real, integer or boolean."""
    return {"f": "real", "b": "boolean"}.get(array.dtype.kind, "integer")


def stored_inputs(spec: Spec) -> dict[str, NDArray]:
    """The inputs of a case as stored."""
    return {name: stored(made.array) for name, made in spec.inputs.items()}


def solve(spec: Spec, operation: Operation, wrong: Mapping[str, Wrong] | None) -> Solved:
    """A case with its answers.

    wrong    answers of wrong ports, by flag; None omits the mistakes
    Raises:  InputError if the case does not reveal a mistake listed in its flags.
    """
    inputs = stored_inputs(spec)
    runs = [reference(operation, inputs, s, "float64", "definition") for s in (spec.settings, *spec.either)]
    asked = {n: a for n, a in JUDGED[operation.name].items() if n in runs[0] and n not in spec.without}
    answers = tuple({name: stored(found[name]) for name in asked} for found in runs)
    expected = answers[0]
    spreads = _spreads(spec, operation, inputs, answers, asked)
    rules = {name: _rule(name, asked[name], spreads[name], len(answers)) for name in asked}
    if spec.flip_budget:
        rules |= _flip_budgets(spec, operation, inputs, expected, rules)
    mistakes = {} if wrong is None else _mistakes(spec, answers, rules, asked, wrong)
    outputs = {}
    for name, value in expected.items():
        caught = [m.shows[name].distance for m in mistakes.values() if name in m.shows]
        caught = [size for size in caught if size is not None and size >= MARGIN * rules[name].float32]
        exact = rules[name].kind == "exact"
        outputs[name] = Output(
            file=f"expected/{name}.npy", level=asked[name].level, unit=asked[name].unit, dtype=kind_of(value),  # type: ignore[arg-type]
            shape=value.shape, compare=rules[name], truth=_truth(asked[name], name in spec.own),
            order=asked[name].order,  # type: ignore[arg-type]
            because=None if exact else Because(spread_float64=_two(spreads[name][0]), spread_float32=_two(
                spreads[name][1]), smallest_mutant=_two(min(caught)) if caught else None),
        )  # fmt: skip
    arrays = {
        name: Array(file=f"inputs/{name}.npy", unit=spec.inputs[name].unit, dtype=kind_of(a), shape=a.shape,  # type: ignore[arg-type]
                    recipe=spec.inputs[name].recipe)
        for name, a in inputs.items()
    }  # fmt: skip
    case = Case(
        family=spec.family, case=spec.case, operation=operation.name, equation=operation.equation,
        pairs=operation.checks(spec.settings), title=spec.title, level=min(o.level for o in outputs.values()),
        flags=spec.flags, settings=spec.settings, inputs=arrays, outputs=outputs, mistakes=mistakes,
    )  # fmt: skip
    return Solved(case, inputs, answers)


def _truth(asked: Judged, own: bool) -> Truth:
    return Truth(kind="oracle", oracle=asked.oracle) if asked.oracle and not own else Truth(kind="self")


def _two(value: float) -> float:
    """Two significant digits."""
    return float(f"{value:.1e}")


def nice(value: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(float(f"{m * power:.0e}") for m in (1, 2, 5, 10) if m * power >= value * (1 - 1e-9))


def _rule(name: str, asked: Judged, spread: tuple[float, float], answers: int) -> Rule:
    if asked.scale == "exact":
        return Rule(kind="exact")
    double, single = (nice(max(FLOOR[p], SAFETY[p] * s)) for p, s in zip(("float64", "float32"), spread))
    single = max(single, asked.least32)
    if asked.scale.startswith("identical"):
        return Rule(kind="identical", scale="max", float64=double, float32=single, to=asked.scale.split()[1])
    others = tuple(f"expected/{name}.answer_{k + 1}.npy" for k in range(1, answers))
    kind = "either-of" if others else "relative"
    return Rule(kind=kind, scale=asked.scale, float64=double, float32=single, others=others)  # type: ignore[arg-type]


def _shaken(spec: Spec, inputs: Inputs, step: float, draw: int) -> dict[str, NDArray]:
    """Every real input times 1 +- step, except for the inputs in `still`."""
    out = dict(inputs)
    for name, array in inputs.items():
        if array.dtype.kind == "f" and name not in spec.still:
            flip = signs(f"{spec.name}/{name}/shake {draw}", array.size).reshape(array.shape)
            out[name] = array * (1.0 + step * flip)
    return out


def _spreads(
    spec: Spec, operation: Operation, inputs: Inputs, answers: tuple[Outputs, ...], asked: dict[str, Judged]
) -> dict[str, tuple[float, float]]:
    def run(arrays: Inputs, precision: str, compositor: Compositor = "definition") -> Outputs:
        return reference(operation, arrays, spec.settings, precision, compositor)

    double = [run(inputs, "float64", "blocks")]
    single = [run(inputs, "float32"), run(inputs, "float32", "blocks")]
    if any(a.dtype.kind == "f" for a in inputs.values()) and operation.name not in ("reading", "training"):
        double += [run(_shaken(spec, inputs, STEP["float64"], k), "float64") for k in (1, 2)]
        single += [run(_shaken(spec, inputs, STEP["float32"], k), "float64") for k in (1, 2)]
    if operation.name == "training":
        double += [run(_shaken(spec, inputs, STEP["float64"], 1), "float64")]
    kinds = {name: asked[name].scale if asked[name].scale in ("max", "last") else "max" for name in asked}

    def off(run: Outputs) -> dict[str, float]:
        """Distances from the nearest legal answer."""
        tries = [{name: largest(run[name], answer[name], kinds[name]) for name in asked} for answer in answers]
        return min(tries, key=lambda sizes: max(sizes.values()))

    pairs = [[off(run) for run in runs] for runs in (double, single)]
    free = {name for name in asked if spec.flip_budget and name.endswith("image")}
    return {
        name: (0.0, 0.0) if name in free else tuple(max(_finite(one[name]) for one in runs) for runs in pairs)
        for name in asked
    }  # type: ignore[return-value]


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("the reference gives numbers that are not finite, or shapes that differ")
    return value


def _flip_budgets(spec: Spec, operation: Operation, inputs: Inputs, expected: Outputs, rules: dict[str, Rule]):
    """Flip budgets: entries that change when the cutoff moves by FLIP_STEP, and by how much."""
    raster, found = spec.settings["raster"], {}
    cut = raster["alpha_cutoff"]
    either = [
        reference(
            operation, inputs, spec.settings | {"raster": raster | {"alpha_cutoff": cut * f}}, "float64", "definition"
        )
        for f in (1 - FLIP_STEP, 1 + FLIP_STEP)
    ]
    for name, rule in rules.items():
        low, high = (stored(e[name]) for e in either)
        flips = int((low != high).sum())
        if flips > 3 * spec.flip_budget:
            raise ValueError(f"{spec.name}: {flips} flips in {name}")
        size = max(largest(low, expected[name], "max"), largest(high, expected[name], "max"))
        found[name] = Rule(kind=FLIP_BUDGET, scale="max", float64=rule.float64, float32=rule.float32, flips=flips,
                           flip_size=nice(1.05 * size))  # fmt: skip
    return found


def _mistakes(
    spec: Spec, answers: tuple[Outputs, ...], rules: dict[str, Rule], asked: dict[str, Judged],
    wrong: Mapping[str, Wrong],
) -> dict[str, Mistake]:  # fmt: skip
    """The visible effect of every wrong port on this case."""
    found: dict[str, Mistake] = {}
    for flag, made in wrong.items():
        shows = _shown(made.double, answers, rules, asked, "float64")
        if made.single is not None:
            single = _shown(made.single, answers, rules, asked, "float32")
            found[flag] = Mistake(shows=shows, rounding=True, shows_float32=single)
        else:
            found[flag] = Mistake(shows=shows)
    _check_flags(spec, found, rules)
    return _without_shared_integers(found, rules)


def _check_flags(spec: Spec, found: Mapping[str, Mistake], rules: dict[str, Rule]) -> None:
    """Raises InputError for a flag of the case whose mistake is not examined on it, or is not far beyond tolerance."""
    if absent := [flag for flag in spec.flags if flag not in found]:
        raise InputError(
            f"{spec.name}: not examined: {', '.join(absent)}; allowed in flags: an entry of golden/makers/*.toml whose"
            f" `operations` name {spec.operation}"
        )
    if small := [flag for flag in spec.flags if not _detected(found[flag], rules)]:
        raise InputError(
            f"{spec.name}: does not show {', '.join(small)}: with the changed lines no output differs by {MARGIN:g}"
            " float32 tolerances or more; choose inputs on which it does, or leave out the flag"
        )


def _detected(mistake: Mistake, rules: dict[str, Rule]) -> bool:
    """Whether a mistake is far beyond the float32 tolerance of some output."""
    return any(
        one.distance is None
        or rules[name].kind in ("exact", "identical")
        or one.distance >= MARGIN * rules[name].float32
        for name, one in mistake.shown("float32").items()
    )


def _shown(
    made: Outputs, answers: tuple[Outputs, ...], rules: dict[str, Rule], asked: dict[str, Judged], precision: str
) -> dict[str, Shown]:
    """Every output of a wrong answer that differs from the nearest legal answer by more than half its tolerance."""
    tries = []
    for right in answers:
        sizes = {name: _size(stored(made[name]), right[name], rules[name], precision) for name in right if name in made}
        tries.append((misses((asked[name].level, size <= 0.5) for name, size in sizes.items()), right, sizes))
    _, right, sizes = min(tries, key=lambda one: one[0])
    return {
        name: _one(name, stored(made[name]), right[name], rules[name]) for name, size in sizes.items() if size > 0.5
    }


def _one(name: str, wrong: NDArray, right: NDArray, rule: Rule) -> Shown:
    if wrong.shape != right.shape:
        return Shown(None, None)
    if rule.kind == "identical":
        return Shown(_two(largest(wrong, right, "max")), None)
    distance = largest(wrong, right, rule.scale or "max")
    number = float(f"{fingerprint(name, wrong):.15g}")
    return Shown(_two(distance) if math.isfinite(distance) else None, number)


def _without_shared_integers(found: dict[str, Mistake], rules: dict[str, Rule]) -> dict[str, Mistake]:
    """Remove fingerprints of integer or boolean outputs that two mistakes have in common."""
    seen: dict[tuple[str, float | None], int] = {}
    for mistake in found.values():
        for name, one in mistake.shows.items():
            seen[name, one.fingerprint] = seen.get((name, one.fingerprint), 0) + 1

    def kept(name: str, one: Shown) -> Shown:
        shared = rules[name].kind == "exact" and seen[name, one.fingerprint] > 1 and one.distance is not None
        return Shown(one.distance, None) if shared else one

    return {
        flag: Mistake(
            shows={name: kept(name, one) for name, one in mistake.shows.items()},
            rounding=mistake.rounding, shows_float32=mistake.shows_float32,
        )
        for flag, mistake in found.items()
    }  # fmt: skip


def _size(wrong: NDArray, right: NDArray, rule: Rule, precision: str) -> float:
    """Distance of a wrong output in tolerances; with a flip budget, flips count too."""
    tolerance = rule.float64 if precision == "float64" else rule.float32
    if wrong.shape != right.shape:
        return math.inf
    if rule.kind in ("exact", "identical"):
        return math.inf if (wrong != right).any() else 0.0
    off = largest(wrong, right, rule.scale)
    if rule.kind == FLIP_BUDGET:
        many = int((distances(wrong, right, rule.scale) > tolerance).sum())
        return off / tolerance if many > 10 * rule.flips or off > 10 * rule.flip_size else 0.0
    return off / tolerance
