"""Settings of the simulator: the scene, and one section with a switch for every effect (sections.py).

Lengths are in millimetres, times in cycles per sequence (the unit of the model's frequencies; t = i / n). An effect
that is off is exactly absent: no part of it is computed, and no random number is drawn for it.
"""

from typing import Annotated

import msgspec

from endotsr.config import Count, NonNegative, Positive, Section
from endotsr.errors import InputError
from endotsr.simulator.sections import (
    AutoExposure,
    Bleeding,
    Breathing,
    Brightening,
    CameraMotion,
    Cutting,
    DepthErrors,
    DepthRounding,
    GainDrift,
    Highlights,
    Instrument,
    MoreInstruments,
    MotionBlur,
    Pull,
    Pulsation,
    SecondLight,
    SensorNoise,
    Shadows,
    Smoke,
    Stereo,
    Vignetting,
)

Side = Annotated[int, msgspec.Meta(ge=16)]
FrameCount = Annotated[int, msgspec.Meta(ge=3)]


class SimulatorSettings(Section, frozen=True, kw_only=True):
    """Scene, size and effects of a simulated sequence."""

    width: Side = 160
    """columns, pixels"""
    height: Side = 128
    """rows, pixels"""
    frames: FrameCount = 24
    """n; frame i shows the time i / n"""
    seed: Count = 0
    """seed of the surface, the texture and all noise"""
    distance: Positive = 50.0
    """from the camera to the middle of the tissue, mm"""
    relief: NonNegative = 1.0
    """factor on the folds of the tissue (1: about +-4 mm)"""
    focal: Positive = 0.89
    """focal length, image widths"""
    block_length: Count = 0
    """0 = every eighth frame is held out; otherwise the length of contiguous held-out blocks, frames"""
    breathing: Breathing = Breathing()
    pulsation: Pulsation = Pulsation()
    pull: Pull = Pull()
    exposure: GainDrift = GainDrift()
    brightening: Brightening = Brightening()
    highlights: Highlights = Highlights()
    instrument: Instrument = Instrument()
    camera_motion: CameraMotion = CameraMotion()
    noise: SensorNoise = SensorNoise()
    depth_errors: DepthErrors = DepthErrors()
    cutting: Cutting = Cutting()
    bleeding: Bleeding = Bleeding()
    second_light: SecondLight = SecondLight()
    more_instruments: MoreInstruments = MoreInstruments()
    shadows: Shadows = Shadows()
    smoke: Smoke = Smoke()
    vignetting: Vignetting = Vignetting()
    auto_exposure: AutoExposure = AutoExposure()
    motion_blur: MotionBlur = MotionBlur()
    stereo: Stereo = Stereo()
    depth_rounding: DepthRounding = DepthRounding()


EFFECTS = (
    "breathing",
    "pulsation",
    "pull",
    "exposure",
    "brightening",
    "highlights",
    "instrument",
    "camera_motion",
    "noise",
    "depth_errors",
    "cutting",
    "bleeding",
    "second_light",
    "more_instruments",
    "shadows",
    "smoke",
    "vignetting",
    "auto_exposure",
    "motion_blur",
    "stereo",
    "depth_rounding",
)


def with_effects(settings: SimulatorSettings, *names: str) -> SimulatorSettings:
    """The same settings with exactly the named effects on and all others off.

    Raises:  InputError for a name that is not in EFFECTS.
    """
    unknown = set(names) - set(EFFECTS)
    if unknown:
        raise InputError(f"effects: unknown: {', '.join(sorted(unknown))}; allowed: {', '.join(EFFECTS)}")
    sections = {name: msgspec.structs.replace(getattr(settings, name), on=name in names) for name in EFFECTS}
    return msgspec.structs.replace(settings, **sections)
