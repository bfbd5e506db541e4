"""Generated parts of docs/bench.md, one function per part; the input is the JSON of `docs/make.py bench measure`."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.results.report.tables import markdown, memory
from endotsr.studies.bench.clock import REST
from pages.bench import peers as bench_peers
from pages.bench.scaling import BASE
from pages.store.tables import noted, where, where_with_cores

Result = Mapping[str, Any]
MAIN = {"gaussians": 60_000, "precision": "float32", "threads": 2, "scene": None}  # the case of the targets
WHOLE = "pulling_paper_"  # the recorded runs with a target time, on the threads of `MAIN`


class Target(NamedTuple):
    """A target: what is measured, the measured value, its bounds and unit."""

    what: str
    found: float | None
    at_most: float | None
    at_least: float | None
    unit: str


def machine(stages: Result) -> str:
    """Date, machine, versions and measured peaks."""
    host, versions = stages["machine"], stages["versions"]
    text = (
        f"Measured on {stages['date'][:10]}: {host['processor']}, {host['cores']} cores, "
        f"{memory(host['memory_bytes'])} of memory, {host['system']}; Python {versions['python']}, "
        f"NumPy {versions['numpy']}, Numba {versions['numba']}."
    )
    rows = [
        [
            str(peak["threads"]),
            *(f"{peak['flop_per_second'][p] / 1e9:.0f}" for p in ("float32", "float64")),
            *(f"{rate / 1e9:.1f}" for rate in peak["bytes_per_second"].values()),
        ]
        for peak in stages["peaks"]
    ]
    head = ["threads", "float32, GFLOP/s", "float64, GFLOP/s", "triad, GB/s", "in-place update, GB/s"]
    return f"{text}\n\n{markdown(head, rows)}"


def targets(stages: Result, scaling: Result, peers: Result, start: Result, runs: Mapping[str, Result]) -> str:
    """Each target with the measured value: of a whole run, every recorded one with the threads of the main case."""
    case = main_case(stages)
    double = find(stages["cases"], MAIN | {"precision": "float64"})
    single_ms = case["iteration"]["median_ms"]
    largest = scaling["axes"]["gaussians"]
    ratios = [c["ratio"] for c in peers["cases"] if c["precision"] == "float32"]
    whole = {
        f"`{name}.json`, {run['machine']['processor']}": run["seconds"] / 60
        for name, run in runs.items()
        if name.startswith(WHOLE) and run["threads"] == MAIN["threads"]
    }
    found = [
        Target("splat, forward and reverse", case["splat"]["median_ms"], 60, None, "ms"),
        Target("full iteration, all losses", single_ms, 100, None, "ms"),
        Target("float64 against float32, iteration", double["iteration"]["median_ms"] / single_ms, 1.8, None, "times"),
        Target("gsplat's torch reference against splat", min(ratios, default=None), None, 50, "times"),
        *(
            Target(f"run of {PAPER.training.iterations} iterations{of}", minutes, 10, None, "min")
            for of, minutes in ({f", {name}": value for name, value in whole.items()} or {"": None}).items()
        ),
        Target("cold start to the first iteration", start["cold"]["first iteration"], 25, None, "s"),
        Target("warm start to the first iteration", start["warm"]["first iteration"], 3, None, "s"),
        Target(
            f"peak memory at {largest['size'][-1]:,.0f} Gaussians",
            (largest["peak_memory_bytes"][-1] or 0) / 1e9 or None, 16, None, "GB",
        ),
    ]  # fmt: skip
    return markdown(["", "measured", "asked for", ""], [_target(t) for t in found])


def _target(target: Target) -> list[str]:
    bound = f"at most {target.at_most:g}" if target.at_most is not None else f"at least {target.at_least:g}"
    if target.found is None:
        return [target.what, "-", f"{bound} {target.unit}", "not measured"]
    held = target.found <= target.at_most if target.at_most is not None else target.found >= (target.at_least or 0)
    return [
        target.what,
        f"{target.found:.3g} {target.unit}",
        f"{bound} {target.unit}",
        "met" if held else "**not met**",
    ]


def stages(found: Result) -> str:
    """The picture, then the table of the stages."""
    picture = "![Stacked bars: time of each stage of one training iteration](results/bench_stages.png)"
    return f"{picture}\n\n{stage_table(found)}"


def stage_table(found: Result) -> str:
    """Every stage of the main case with its limit."""
    case = main_case(found)
    total, rows = case["iteration"]["median_ms"], []
    for name, spread in case["stages"].items():
        limit = case["limits"].get(name)
        rows.append([name, *_times(spread), f"{spread['median_ms'] / total:.0%}", *_limit(limit)])
    rows.append(["**iteration**", *_times(case["iteration"]), "100%", "", "", ""])
    dense = case["densification"]
    after = (
        f"A densification, once in a hundred iterations, takes {dense['median_ms']:.0f} ms: "
        f"{dense['per_iteration_ms']:.2f} ms per iteration."
    )
    head = ["stage", "median, ms", "quartiles, ms", "fraction", "limit, ms", "of the limit", "bound by"]
    return f"{markdown(head, rows)}\n\n{after}"


def _times(spread: Result) -> list[str]:
    low, high = spread["quartiles_ms"]
    return [f"{spread['median_ms']:.2f}", f"{low:.2f} - {high:.2f}"]


def _limit(limit: Result | None) -> list[str]:
    if limit is None:
        return ["", "", ""]
    reached = f"{limit['fraction']:.0%}" if limit["fraction"] is not None else "-"
    return [f"{limit['limit_ms']:.2f}", reached, limit["bound"]]


def gain(found: Result) -> str:
    """The stages with most time above their limit, and so the largest possible gains."""
    case = main_case(found)
    above = {
        name: case["stages"][name]["median_ms"] - limit["limit_ms"]
        for name, limit in case["limits"].items()
        if name != REST
    }
    first = sorted(above, key=lambda name: -above[name])[:4]
    rows = [[name, f"{above[name]:.1f}", f"{above[name] / case['iteration']['median_ms']:.0%}"] for name in first]
    floor = sum(limit["limit_ms"] for limit in case["limits"].values())
    sentence = f"The limits of all stages add up to {floor:.1f} ms of {case['iteration']['median_ms']:.1f} ms."
    return f"{sentence}\n\n{markdown(['stage', 'above its limit, ms', 'of the iteration'], rows)}"


def cases(found: Result) -> str:
    """One line for every case; float64 is compared with float32 if that was measured."""
    same = lambda case: tuple(value for name, value in case["case"].items() if name != "precision")
    single = {same(c): c["iteration"]["median_ms"] for c in found["cases"] if c["case"]["precision"] == "float32"}
    rows = []
    for case in found["cases"]:
        size, ns, ms = case["case"], case["ns_per_pair"], case["iteration"]["median_ms"]
        double = size["precision"] == "float64" and same(case) in single
        rows.append(
            [
                size["scene"] or f"{size['gaussians']:,}", size["precision"], str(size["threads"]),
                f"{ms:.1f}", f"{ms / single[same(case)]:.2f}" if double else "", f"{case['splat']['median_ms']:.1f}",
                f"{case['view']['blended'] / 1e6:.2f}",
                *("-" if ns[name] is None else f"{ns[name]:.2f}" for name in ("blend forward", "blend reverse")),
                memory(case["peak_memory_bytes"]),
            ]
        )  # fmt: skip
    head = ["Gaussians", "precision", "threads", "iteration, ms", "times float32", "splat, ms", "blended pairs, M"]
    head += ["blend forward, ns a pair", "blend reverse, ns a pair", "peak memory"]
    return noted(head, rows, f"{where(found)}.")


def scaling(found: Result) -> str:
    """The picture, the exponents and the memory."""
    rows = []
    for axis in found["axes"].values():
        fits = ", ".join(f"{name} {power:.2f}" for name, power in axis["exponent"].items() if power is not None)
        rows.append([axis["unit"], f"{min(axis['size']):,.0f} to {max(axis['size']):,.0f}", fits])
    steepest = max(
        (power, name, axis["unit"])
        for axis in found["axes"].values()
        for name, power in axis["exponent"].items()
        if power is not None
    )
    largest = found["axes"]["gaussians"]
    lines = [
        "![Cost against each size, with fitted powers](results/scaling.png)",
        markdown(["along", "range", "exponents over the upper decade"], rows),
        f"The steepest of them is {steepest[0]:.2f} ({steepest[1]} along {steepest[2]}).",
        _memory(found["memory"], largest),
        f"{BASE.threads} threads; {where(found)}.",
    ]
    return "\n\n".join(lines)


def _memory(slopes: Result, largest: Result) -> str:
    count, state = largest["size"][-1], largest["state_bytes"][-1]
    each = slopes["bytes_per_gaussian"]
    peak = f"{each / 1e3:.1f} kB per Gaussian at the peak" if each else "a peak that the system does not report"
    text = f"Memory: {peak}, of which parameters and their two moments are {state / count / 1e3:.1f} kB"
    frame = slopes["bytes_per_frame"]
    text += f"; {frame / 1e6:.1f} MB per frame for the picture and its targets." if frame else "."
    seconds = largest["median_ms"]["iteration"][-1] / 1e3
    return (
        f"{text} {count:,.0f} Gaussians train at {seconds:.2f} s per iteration with all losses, "
        f"in {memory(largest['peak_memory_bytes'][-1])}."
    )


def peers(found: Result) -> str:
    """Times, ratio and errors of every comparison."""
    rows, blocks = [], []
    for case in found["cases"]:
        times = [f"{case[name]['median_ms']:,.0f}" for name in ("ours", "gsplat", "pair_lists")]
        size = [f"{case['gaussians']:,}", case["precision"]]
        rows.append([*size, *times, f"{case['ratio']:.0f}", bench_peers.verdict(case)])
        blocks.append([*size, *(f"{error:.1e}" for error in case["errors"].values())])
    first = found["cases"][0]
    head = ["Gaussians", "precision", "endotsr, ms", "gsplat, ms", "its pair lists, ms", "ratio", "largest error"]
    versions = f"gsplat {first['versions']['gsplat']}, torch {first['versions']['torch']}"
    about = (
        f"Measured on {found['date'][:10]} on {found['machine']['processor']} with {versions}, {first['threads']} "
        "threads. gsplat uses its reference in tests, and it is not meant for speed; its counted time contains our "
        "dense table."
    )
    names = [name.replace("_", " ") for name in first["errors"]]
    return f"{markdown(head, rows)}\n\n{about}\n\n{markdown(['Gaussians', 'precision', *names], blocks)}"


def start(found: Result) -> str:
    """Cold start, and the median of the warm ones, by moment."""
    rows = [[moment, f"{found['cold'][moment]:.1f}", f"{found['warm'][moment]:.1f}"] for moment in found["cold"]]
    about = f"One cold start; medians of {found['warm_repeats']} warm ones. {where_with_cores(found)}."
    return noted(["seconds from the call to", "cold", "warm"], rows, about)


def runs(found: Mapping[str, Result]) -> str:
    """Recorded whole runs."""
    rows = [
        [
            f"`{name}.json`", run["started"][:10], f"{run['seconds'] / 60:.1f}", str(run["iteration"]),
            f"{run['gaussians']:,}", memory(run["peak_memory_bytes"]), str(run["threads"]),
            run["machine"]["processor"],
        ]
        for name, run in found.items()
    ]  # fmt: skip
    heads = ["run", "date", "minutes", "iterations", "Gaussians at the end", "peak memory", "threads", "processor"]
    return markdown(heads, rows)


def main_case(found: Result) -> Result:
    """The case of the targets."""
    return find(found["cases"], MAIN)


def find(results: Sequence[Result], wanted: Mapping[str, Any]) -> Result:
    """The result of the case with these values. Raises: InputError if there is none."""
    for result in results:
        if all(result["case"][key] == value for key, value in wanted.items()):
            return result
    raise InputError(
        f"the stages hold no case with {dict(wanted)}; measure it with `python docs/make.py bench measure`"
    )
