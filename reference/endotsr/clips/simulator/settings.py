"""Settings of the simulator: the scene, and one section with a switch for each effect (sections.py).

Lengths are in millimetres or in image widths, as each key says, rates in cycles per sequence (the unit of the model's
frequencies; t = i / n). An effect that is off is not computed and draws no random numbers.
"""

from typing import Annotated

import msgspec

from endotsr.clips.simulator import sections
from endotsr.errors import InputError
from endotsr.untrusted.files import MOST_PIXELS
from endotsr.untrusted.names import choice
from endotsr.untrusted.sections import Count, NonNegative, Positive, Section

Side = Annotated[int, msgspec.Meta(ge=16)]
FrameCount = Annotated[int, msgspec.Meta(ge=3)]
Distance = Annotated[float, msgspec.Meta(gt=0, le=10000)]  # the sheet of tissue, and its memory, grow with it


class SimulatorSettings(Section, frozen=True, kw_only=True):
    """Scene, size and effects of a simulated sequence."""

    width: Side = 160
    """columns, pixels"""
    height: Side = 128
    """rows, pixels"""
    frames: FrameCount = 24
    """n; frame i is at time i / n"""
    seed: Count = 0
    """seed of the surface, the texture and all noise"""
    distance: Distance = 50.0
    """from the camera to the middle of the tissue, mm"""
    relief: NonNegative = 1.0
    """factor on the folds of the tissue (1: 5 mm at most to either side)"""
    focal: Positive = 0.89
    """focal length, image widths"""
    block_length: Count = 0
    """0 = every eighth frame is held out; otherwise the length of contiguous held-out blocks, frames"""
    breathing: sections.Breathing = sections.Breathing()
    pulsation: sections.Pulsation = sections.Pulsation()
    pull: sections.Pull = sections.Pull()
    exposure: sections.GainDrift = sections.GainDrift()
    brightening: sections.Brightening = sections.Brightening()
    highlights: sections.Highlights = sections.Highlights()
    instrument: sections.Instrument = sections.Instrument()
    camera_motion: sections.CameraMotion = sections.CameraMotion()
    noise: sections.SensorNoise = sections.SensorNoise()
    depth_errors: sections.DepthErrors = sections.DepthErrors()
    cutting: sections.Cutting = sections.Cutting()
    bleeding: sections.Bleeding = sections.Bleeding()
    second_light: sections.SecondLight = sections.SecondLight()
    more_instruments: sections.MoreInstruments = sections.MoreInstruments()
    shadows: sections.Shadows = sections.Shadows()
    smoke: sections.Smoke = sections.Smoke()
    vignetting: sections.Vignetting = sections.Vignetting()
    auto_exposure: sections.AutoExposure = sections.AutoExposure()
    motion_blur: sections.MotionBlur = sections.MotionBlur()
    stereo: sections.Stereo = sections.Stereo()
    depth_rounding: sections.DepthRounding = sections.DepthRounding()

    def refuse_contradictions(self, where: str) -> None:
        """Raise InputError for pictures that no reader takes, or an effect that ends before it begins."""
        if self.width * self.height > MOST_PIXELS:
            raise InputError(
                f"{where}: {self.width}x{self.height} pixels are not allowed; use at most {MOST_PIXELS} in all"
            )
        for name, part in (("pull", self.pull), ("smoke", self.smoke)):
            if part.on and part.stop <= part.start:
                raise InputError(
                    f"{where}: {name}.stop = {part.stop:g} is not allowed; use a number above {name}.start ="
                    f" {part.start:g}"
                )


EFFECTS = tuple(
    field.name for field in msgspec.structs.fields(SimulatorSettings) if isinstance(field.default, sections.Effect)
)


def with_effects(settings: SimulatorSettings, *names: str) -> SimulatorSettings:
    """The same settings with the named effects on and all others off.

    Raises:  InputError for a name that is not in EFFECTS.
    """
    unknown = set(names) - set(EFFECTS)
    if unknown:
        raise InputError(f"effects: unknown: {', '.join(sorted(unknown))}; use {choice(EFFECTS)}")
    switched = {name: msgspec.structs.replace(getattr(settings, name), on=name in names) for name in EFFECTS}
    return msgspec.structs.replace(settings, **switched)
