"""`endotsr inspect`: the effects in a clip, and the components that it needs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile
from endotsr.config import PAPER, Config
from endotsr.errors import InputError
from endotsr.training.runs.files import write_json
from endotsr.untrusted.writing import replace_text

SHORT = ("sequence.scale", "sequence.frames", "sequence.masks")


@dataclass
class InspectOptions:
    """Test the training frames of a sequence for every effect, and plan the components that the clip needs.

    The plan is a change of the settings given here (preset, TOML file, options). `endotsr train --effects auto`
    applies it.
    """

    sequence: Annotated[str, Option("SEQUENCE", positional=True)]
    """sequence folder, or `simulated`"""
    out: Annotated[Path | None, Option("report.html", written=True)] = None
    """write a self-contained page with pictures"""
    json: JsonFile = None
    """write verdicts and plan as JSON"""
    frame_rate: Annotated[float | None, Option("FPS")] = None
    """frames per second, to give rates per minute too (default: the recording's frame rate, if known)"""
    config: Annotated[Path | None, Option("FILE.toml")] = None
    """initial settings"""
    settings: Annotated[Config, Option(flat=True, short=SHORT)] = PAPER


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.clips.effects.inspect import inspect_sequence, inspection_record
    from endotsr.clips.effects.plan import make_plan, plan_record
    from endotsr.clips.simulator.settings import SimulatorSettings
    from endotsr.results.report.inspection import inspection_html, inspection_text
    from endotsr.training.runs.sources import load_sequence

    base, _ = base_settings(words)
    options = parse(InspectOptions, words, "inspect", InspectOptions("", settings=base))
    if not options.sequence:
        raise InputError("inspect: SEQUENCE is missing: a sequence folder, or the word `simulated`")
    sequence = load_sequence(options.sequence, options.settings, SimulatorSettings())
    for said in sequence.not_read:
        print(f"note: {said}")
    inspection = inspect_sequence(sequence, options.frame_rate)
    plan = make_plan(inspection, options.settings)
    print(inspection_text(inspection, plan))
    if options.out:
        replace_text(options.out, inspection_html(Path(options.sequence).absolute().name, inspection, plan))
        print(f"report: {options.out}")
    if options.json:
        write_json(options.json, inspection_record(inspection) | {"plan": plan_record(plan)})
    return 0
