"""`endotsr simulate`: write a simulated sequence and its ground truth as a folder."""

import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.progress import StepBar
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.clips.simulator.scenes import SCENES, effects_on, named_scene, scene_of
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.errors import InputError
from endotsr.training.runs.files import os_error_line
from endotsr.training.runs.folder import refuse_existing
from endotsr.untrusted.names import choice, counted
from endotsr.untrusted.writing import replacing_folder

STILL = named_scene("still")
PREPARE = "next: endotsr prepare {} --out FOLDER"


@dataclass
class SimulateOptions:
    """Simulate a scene with known effects, and write it with the exact ground truth.

    SCENE is still, breathing, pulling, cutting, smoke, moving-camera or everything; options change its size, seed and
    effects. Layout endonerf is for `endotsr train OUT`; layout stereomis is a raw recording for `endotsr prepare OUT`.
    OUT/truth contains depth, motion, light and masks.
    """

    scene: Annotated[str, Option("[SCENE]", positional=True)] = ""
    """name of a scene; not needed with --effects"""
    out: Annotated[Path | None, Option("FOLDER")] = None
    """sequence folder to create (required)"""
    effects: Annotated[str | None, Option("NAME,..")] = None
    """exactly these effects, instead of a scene's; empty for none"""
    json: JsonFile = None
    """also write a record of the simulation as JSON"""
    layout: Literal["endonerf", "stereomis"] = "endonerf"
    """endonerf: pictures, depth, masks and poses; stereomis: stacked video, calibration, trajectory and masks"""
    lossless: bool = False
    """with the layout stereomis: a lossless video instead of a compressed one"""
    settings: Annotated[SimulatorSettings, Option(flat=True)] = STILL


def run(words: list[str]) -> int:
    """The command."""
    options = parse(SimulateOptions, words, "simulate")
    if options.out is None:
        raise InputError("simulate: --out FOLDER is missing: the sequence folder to create")
    if not options.scene and options.effects is None:
        raise InputError(f"simulate: SCENE is missing; use {choice(SCENES)}, or --effects NAME,..")
    base = named_scene(options.scene) if options.scene else STILL
    base = base if options.effects is None else scene_of(options.effects)
    settings = parse(SimulateOptions, words, "simulate", SimulateOptions(settings=base)).settings
    _refuse_idle(settings, given_names(SimulateOptions, words))
    _write(options, settings, options.scene if options.effects is None else options.effects)
    write_result(
        options.json,
        folder=options.out,
        truth=options.out / "truth",
        effects=effects_on(settings),
        settings=msgspec.to_builtins(settings),
    )
    advice = "train with: endotsr train {} --out RUN" if options.layout == "endonerf" else PREPARE
    print(f"truth in {options.out}/truth; {advice.format(shlex.quote(str(options.out)))}")
    return 0


def _refuse_idle(settings: SimulatorSettings, given: frozenset[str]) -> None:
    """Raises InputError for an option of an effect that is off; further graspers move like the first one."""
    on = set(effects_on(settings))
    on |= {"instrument"} if "more_instruments" in on else set()
    for name in sorted(given):
        effect, dot, key = name.partition(".")
        if dot and key != "on" and effect.replace("-", "_") not in on:
            raise InputError(f"simulate: --{name} has no effect: {effect} is off; add --{effect}.on, or omit --{name}")


def _write(options: SimulateOptions, settings: SimulatorSettings, name: str) -> None:
    """Check the options and the output path, then write the folder atomically."""
    from endotsr.clips.simulator import folder, stereomis

    out, raw = options.out, options.layout == "stereomis"
    assert out is not None
    recording = partial(stereomis.write_recording, lossless=options.lossless)
    check, write = (stereomis.check_recording, recording) if raw else (folder.check_scene, folder.write_sequence)
    if options.lossless and not raw:
        raise InputError("simulate: --lossless needs --layout stereomis; the other layout is always lossless")
    refuse_existing(out)
    check(settings)
    print(
        f"{counted(settings.frames, 'frame')} of {settings.width}x{settings.height}, seed {settings.seed}", flush=True
    )
    print(f"effects: {', '.join(effects_on(settings))}", flush=True)
    try:
        out.absolute().parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(out) as place, StepBar("frames") as bar:
            bar.begin(settings.frames)
            write(place, settings, name, bar.step)
    except OSError as error:
        raise InputError(os_error_line(error, out)) from None
