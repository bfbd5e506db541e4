"""`endotsr bench`: time by stage, growth with size, comparison with a peer, and cold start."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from endotsr.cli.parts.bench_options import (
    AllOptions,
    EffectsOptions,
    IterationOptions,
    PeersOptions,
    ScalingOptions,
    StagesOptions,
    StartOptions,
)
from endotsr.cli.parts.parser import parse
from endotsr.errors import InputError
from endotsr.runs.files import refuse_unwritable, write_json

LEAST = {"gaussians": 4, "largest": 1000, "repeats": 1, "width": 16, "height": 16, "threads": 0}
MORE = {"stages": {"threads": 1}, "peers": {"threads": 1}}  # their results state the number, so 0 is not allowed


def run(words: list[str]) -> int:
    """The command; the first word selects the measurement."""
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
        return 0
    what, rest = (words[0], words[1:]) if not words[0].startswith("-") else ("iteration", words)
    if what not in MEASURES:
        raise InputError(f"bench: unknown {what!r}; allowed: {', '.join(MEASURES)}")
    options, measure = MEASURES[what]
    chosen = parse(options, rest, f"bench {what}")
    _refuse_nothing(what, chosen)
    refuse_unwritable(getattr(chosen, "json", None), getattr(chosen, "plot", None))
    _refuse_other_pictures(getattr(chosen, "plot", None))
    measure(chosen)
    return 0


def _refuse_nothing(what: str, options: Any) -> None:
    for name, least in (LEAST | MORE.get(what, {})).items():
        values = getattr(options, name, least)
        for value in values if isinstance(values, tuple) else (values,):
            if value < least:
                raise InputError(f"bench: --{name} {value} is not allowed; allowed: an integer >= {least}")
    if isinstance(options, StagesOptions) and not options.gaussians and not options.scenes:
        raise InputError(
            "bench: --gaussians is empty, which leaves nothing to time; allowed: one or more, or none with --scenes"
        )


def _refuse_other_pictures(plot: Path | None) -> None:
    """Raises: InputError for an unsupported kind of picture, before the measurement."""
    if plot is not None and plot.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"bench: --plot {plot} is not allowed; allowed: a file whose name ends in .png or .svg")


def _overview() -> str:
    lines = ["usage: endotsr bench WHAT [OPTIONS]", "", "what to measure:"]
    lines += [f"  {name:<10}{(options.__doc__ or '').splitlines()[0]}" for name, (options, _) in MEASURES.items()]
    return "\n".join(
        [*lines, "", "`endotsr bench WHAT --help` lists the options; options without WHAT measure `iteration`."]
    )


def _record(path: Path | None, result: dict[str, Any]) -> None:
    from endotsr.bench.suite import dated

    if path:
        write_json(path, dated(result))


def _iteration(options: IterationOptions) -> None:
    import msgspec

    from endotsr.bench.iteration import benchmark_iteration, table
    from endotsr.config import PAPER
    from endotsr.kernels.threads import use_threads

    threads = use_threads(options.threads)
    config = msgspec.structs.replace(
        PAPER, training=msgspec.structs.replace(PAPER.training, precision=options.precision)
    )
    result = benchmark_iteration(options.gaussians, options.repeats, options.width, options.height, config)
    print(
        f"one training iteration: {options.gaussians} Gaussians, {options.width}x{options.height}, colour and depth, "
        f"all losses, {options.precision}, {threads} threads, {options.repeats} repeats"
    )
    print(table(result))
    peak = result["peak_memory_bytes"]
    print(f"first iteration, compiled code loaded or made: {result['first_iteration_s']:.1f} s")
    print(f"peak memory: {peak / 1e9:.2f} GB" if peak else "peak memory: not known")
    _record(options.json, result | {"threads": threads})


def _stages(options: StagesOptions) -> None:
    from endotsr.bench import charts, stages

    result = stages.measure_stages(stages.grid(options), print)
    for case in result["cases"]:
        print(f"\n{stages.name_of(case['case'])}\n{stages.table(case)}")
    _record(options.json, result)
    if options.plot:
        charts.stage_bars(result["cases"], options.plot)


def _effects(options: EffectsOptions) -> None:
    from endotsr.bench.effects import benchmark_effects, table
    from endotsr.kernels.threads import use_threads

    use_threads(options.threads)
    result = benchmark_effects(options.gaussians, options.repeats, options.width, options.height)
    print(table(result))
    _record(options.json, result | {"threads": options.threads})


def _scaling(options: ScalingOptions) -> None:
    from endotsr.bench import charts, scaling

    result = scaling.measure_scaling(options.largest, options.axes, print)
    print(scaling.table(result))
    _record(options.json, result)
    if options.plot:
        charts.scaling_curves(result["axes"], options.plot)


def _peers(options: PeersOptions) -> None:
    from endotsr.bench import peers

    result = peers.measure_peers(options.gaussians, options.precisions, options.threads, options.repeats)
    print(peers.table(result))
    _record(options.json, result)


def _start(options: StartOptions) -> None:
    from endotsr.bench import start

    result = start.measure_start(options.repeats)
    print(start.table(result))
    _record(options.json, result)


def _all(options: AllOptions) -> None:
    from endotsr.bench import suite

    suite.run_all(options.out, options.scenes, print)


MEASURES: dict[str, tuple[type, Callable[[Any], None]]] = {
    "iteration": (IterationOptions, _iteration),
    "stages": (StagesOptions, _stages),
    "effects": (EffectsOptions, _effects),
    "scaling": (ScalingOptions, _scaling),
    "peers": (PeersOptions, _peers),
    "start": (StartOptions, _start),
    "all": (AllOptions, _all),
}
