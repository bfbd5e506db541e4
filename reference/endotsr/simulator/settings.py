"""Settings of the simulator: the scene, and one section with a switch for every effect.

Lengths are in millimetres, times in cycles per sequence (the unit of the model's frequencies; t = i / n). An effect
that is off is exactly absent: no part of it is computed, and no random number is drawn for it.
"""

from typing import Annotated

import msgspec

from endotsr.config import Count, Fraction, NonNegative, Positive, Section

Side = Annotated[int, msgspec.Meta(ge=16)]
FrameCount = Annotated[int, msgspec.Meta(ge=3)]


class Breathing(Section, frozen=True, kw_only=True):
    """Every breath lifts the whole tissue towards the camera and shifts it, unevenly."""

    on: bool = True
    """switch"""
    amplitude: NonNegative = 2.5
    """largest displacement, mm"""
    cycles: Positive = 1.5
    """breaths per sequence"""


class Pulsation(Section, frozen=True, kw_only=True):
    """A round region beats; the beat has two harmonics."""

    on: bool = True
    """switch"""
    amplitude: NonNegative = 0.7
    """scale of the displacement, mm (the beat reaches 1.2 times this)"""
    cycles: Positive = 5.0
    """beats per sequence"""
    width: Positive = 9.0
    """Gaussian radius of the region, mm"""


class Pull(Section, frozen=True, kw_only=True):
    """A spot is pulled sideways and towards the camera, held, and released."""

    on: bool = True
    """switch"""
    amplitude: NonNegative = 5.0
    """displacement of the spot while it is held, mm"""
    width: Positive = 11.0
    """Gaussian radius of the tissue that moves along, mm"""
    start: Fraction = 0.15
    """normalised time at which the pull begins"""
    stop: Fraction = 0.9
    """normalised time at which the tissue is back"""


class Exposure(Section, frozen=True, kw_only=True):
    """The gain of the camera drifts, red and blue slightly apart (white balance)."""

    on: bool = True
    """switch"""
    amplitude: Fraction = 0.15
    """relative change of the gain, linear light"""
    cycles: Positive = 1.0
    """cycles per sequence"""


class Brightening(Section, frozen=True, kw_only=True):
    """A region of the tissue itself grows paler and recovers (as under pressure)."""

    on: bool = True
    """switch"""
    amplitude: NonNegative = 0.6
    """relative change at its centre, linear light"""
    cycles: Positive = 2.0
    """cycles per sequence"""
    width: Positive = 8.0
    """Gaussian radius, mm"""


class Highlights(Section, frozen=True, kw_only=True):
    """Mirror reflections of the light on the wet surface."""

    on: bool = True
    """switch"""
    strength: NonNegative = 1.0
    """brightness, linear light"""
    exponent: Positive = 150.0
    """sharpness"""


class Instrument(Section, frozen=True, kw_only=True):
    """A grasper in front of the tissue. It is drawn; the mask and the prior depth exclude its pixels."""

    on: bool = True
    """switch"""
    travel: NonNegative = 0.06
    """radius of the path of its tip, image widths"""
    cycles: Positive = 1.0
    """cycles per sequence"""
    margin: NonNegative = 0.006
    """width of the masked border around the drawn instrument, image widths"""


class CameraMotion(Section, frozen=True, kw_only=True):
    """The camera swings around the middle of the tissue; off = one Camera object for all frames."""

    on: bool = False
    """switch"""
    amplitude: NonNegative = 3.0
    """largest sideways shift of the camera, mm"""
    cycles: Positive = 1.0
    """cycles per sequence"""


class Noise(Section, frozen=True, kw_only=True):
    """Sensor noise in the picture."""

    on: bool = True
    """switch"""
    sigma: NonNegative = 0.01
    """standard deviation, display units [0, 1]"""


class DepthErrors(Section, frozen=True, kw_only=True):
    """Errors of stereo matching in the prior depth. The true depth is stored separately and stays exact."""

    on: bool = False
    """switch"""
    sigma: NonNegative = 0.5
    """standard deviation, mm"""
    strip: Fraction = 0.07
    """columns without depth at the left, image widths"""


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
    exposure: Exposure = Exposure()
    brightening: Brightening = Brightening()
    highlights: Highlights = Highlights()
    instrument: Instrument = Instrument()
    camera_motion: CameraMotion = CameraMotion()
    noise: Noise = Noise()
    depth_errors: DepthErrors = DepthErrors()


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
)


def with_effects(settings: SimulatorSettings, *names: str) -> SimulatorSettings:
    """The same settings with exactly the named effects on and all others off.

    Raises:  ValueError for a name that is not in EFFECTS.
    """
    unknown = set(names) - set(EFFECTS)
    if unknown:
        raise ValueError(f"unknown effects {sorted(unknown)}; allowed: {', '.join(EFFECTS)}")
    sections = {name: msgspec.structs.replace(getattr(settings, name), on=name in names) for name in EFFECTS}
    return msgspec.structs.replace(settings, **sections)
