"""`endotsr ablate`: components of the method on and off, over several seeds, with paired differences."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile
from endotsr.cli.sweep import ended, run_spec
from endotsr.config import PRESETS, Preset, with_iterations
from endotsr.errors import InputError
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import choice

if TYPE_CHECKING:
    from endotsr.studies.sweeps.ablation_page import AblationRecord
    from endotsr.studies.sweeps.sweep import Rows


@dataclass
class AblateOptions:
    """Train the configurations base, A, S, L, A+S, A+S+L and S without its prior on every SEQUENCE and seed.

    Differences between configurations are paired by sequence and seed, with mean, median and intervals. With
    --fixed-count, every configuration is also trained from the same checkpoint of the base without density control,
    that is, with the same number of Gaussians. An interrupted command continues when repeated, as `endotsr sweep`.
    """

    sequences: Annotated[tuple[str, ...], Option("SEQUENCE ...", positional=True)]
    """sequence folders, or `simulated`"""
    out: Annotated[Path, Option("DIR")]
    """folder of the sweep"""
    seeds: Annotated[int, Option("N")] = 3
    """number of seeds, starting at 0"""
    preset: Preset = "paper"
    """settings of every run"""
    iterations: Annotated[int | None, Option("N")] = None
    """exact length of every run; stretches the schedule"""
    scale: float = 1.0
    """image scale"""
    splits: Annotated[tuple[str, ...], Option("SPLIT ...")] = ("every_eighth",)
    """held-out frames, one or more of every_eighth, every_second, "blocks N", "end N\""""
    configurations: Annotated[tuple[str, ...], Option("NAME ...")] = ()
    """only these configurations (default: all seven)"""
    fixed_count: bool = True
    """also train with a fixed number of Gaussians"""
    measures: Annotated[tuple[str, ...], Option("NAME ...")] = ()
    """additional measurements: depth, flicker, right_view"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights"""
    keep_checkpoints: bool = False
    """keep the model of every run (several hundred megabytes each at full size)"""
    collect: bool = False
    """write the results of finished runs without training"""
    json: JsonFile = None
    """also write the results to this file"""
    workers: Annotated[int | None, Option("N")] = None
    """concurrent runs (default: as many as cores and free memory allow)"""
    threads: Annotated[int | None, Option("N")] = None
    """threads per run (default: the cores divided by the runs)"""
    scheduler: Annotated[str | None, Option("ADDRESS")] = None
    """send the runs to the workers of this Dask scheduler"""
    retry: bool = False
    """repeat failed runs"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.studies.sweeps.ablation_page import FILES, ablation_markdown, write_ablation
    from endotsr.studies.sweeps.jobs import RUNS
    from endotsr.studies.sweeps.place import Place, check_place
    from endotsr.studies.sweeps.spec import spec_of
    from endotsr.training.runs.files import refuse_folder, write_json
    from endotsr.untrusted.marks import refuse_foreign

    options = parse(AblateOptions, words, "ablate")
    place = Place(options.workers, options.threads, options.scheduler)
    check_place("ablate", place)
    spec = spec_of(spec_data(options), "ablate", Path.cwd())
    for name in FILES:
        refuse_foreign(options.out / name, beside=options.out / RUNS)
    records: list[AblationRecord] = []  # the latest record
    command = ["endotsr", "ablate", *map(without_folders, words)]

    def on_rows(rows: "Rows") -> None:
        records[:] = [write_ablation(options.out, rows, command)]
        if options.json is not None:
            write_json(options.json, records[0])

    if options.collect:
        from endotsr.studies.sweeps.sweep import Inputs, lacking, planned

        refuse_folder(options.out)
        options.out.mkdir(parents=True, exist_ok=True)
        plan = planned(spec, options.out, Inputs(keep=False), retry=False)
        on_rows(list(plan.rows.values()))
        print(ablation_markdown(records[0]))
        for line in lacking(plan):
            print(line)
        return 0
    rows = run_spec(spec, options.out, place, options.retry, on_rows)
    print(ablation_markdown(records[0]))
    return ended(rows, options.out)


def without_folders(word: str) -> str:
    """A word of the command for the record: a path is reduced to its last name, because records are published."""
    head, equals, value = word.rpartition("=")
    path = Path(value)
    return f"{head}{equals}{path.name}" if path.is_absolute() or path.exists() else word


def spec_data(options: AblateOptions) -> Keys:
    """The sweep for the options, in the form of a SPEC.toml. Raises InputError for invalid options."""
    from endotsr.studies.sweeps.ablation import CONFIGURATIONS, ablation_spec

    if options.seeds < 1:
        raise InputError(f"ablate: --seeds {options.seeds} is not allowed; use an integer >= 1")
    for name in options.configurations:
        if name not in CONFIGURATIONS:
            raise InputError(f"ablate: --configurations {name!r} is not allowed; use {choice(CONFIGURATIONS)}")
    length = PRESETS[options.preset].training.iterations if options.iterations is None else options.iterations
    if length < 2:
        raise InputError(f"ablate: --iterations {length} is not allowed; use an integer >= 2")
    activation = with_iterations(PRESETS[options.preset], length).training.residual_activation
    keys: Keys = {"preset": options.preset, "splits": list(options.splits)}
    if options.iterations is not None:
        keys["iterations"] = length
    if options.lpips is not None:
        keys["lpips"] = str(options.lpips)
    return ablation_spec(
        options.sequences,
        options.seeds,
        fixed_at=min(activation, length - 1) if options.fixed_count else None,
        chosen=options.configurations or CONFIGURATIONS,
        settings={"sequence": {"scale": options.scale}},
        measures=list(options.measures),
        keep_checkpoints=options.keep_checkpoints,
        **keys,
    )
