"""One section of settings for each effect of the simulator, with a switch `on`.

Lengths are in millimetres or in image widths, as each key says, rates in cycles per sequence (the unit of the model's
frequencies; t = i / n), times in normalised time in [0, 1]. The effects act in this order: motion, light, instruments,
camera, depth.
"""

from typing import Annotated, Literal

import msgspec

from endotsr.untrusted.sections import Fraction, NonNegative, Positive, PositiveCount, Section


class Effect(Section, frozen=True, kw_only=True):
    """An effect that is off by default."""

    on: bool = False
    """switch"""


class ActiveEffect(Effect, frozen=True, kw_only=True):
    """An effect that is on by default."""

    on: bool = True
    """switch"""


class Breathing(ActiveEffect, frozen=True, kw_only=True):
    """Each breath lifts the whole tissue towards the camera and shifts it, unevenly."""

    amplitude: NonNegative = 2.5
    """largest displacement, mm"""
    cycles: Positive = 1.5
    """breaths per sequence"""


class Pulsation(ActiveEffect, frozen=True, kw_only=True):
    """A round region beats; the beat has two harmonics."""

    amplitude: NonNegative = 0.7
    """scale of the displacement, mm (the beat reaches 1.2 times this)"""
    cycles: Positive = 5.0
    """beats per sequence"""
    width: Positive = 9.0
    """Gaussian radius of the region, mm"""


class Pull(ActiveEffect, frozen=True, kw_only=True):
    """A spot is pulled sideways and towards the camera, held, and released."""

    amplitude: NonNegative = 5.0
    """displacement of the spot while it is held, mm"""
    width: Positive = 11.0
    """Gaussian radius of the pulled region, mm"""
    start: Fraction = 0.15
    """normalised time at which the pull begins"""
    stop: Fraction = 0.9
    """normalised time at which the tissue has returned"""


class GainDrift(ActiveEffect, frozen=True, kw_only=True):
    """The gain of the camera drifts, red and blue slightly apart (white balance)."""

    amplitude: Fraction = 0.15
    """largest difference of the red gain from 1 (green: 0.85 times that; blue: up to 1.07 times), linear light"""
    cycles: Positive = 1.0
    """cycles per sequence"""


class Brightening(ActiveEffect, frozen=True, kw_only=True):
    """A region of the tissue itself grows paler and recovers (as under pressure)."""

    amplitude: NonNegative = 0.6
    """relative change at its centre, linear light"""
    cycles: Positive = 2.0
    """cycles per sequence"""
    width: Positive = 8.0
    """Gaussian radius, mm"""


class Highlights(ActiveEffect, frozen=True, kw_only=True):
    """Mirror reflections of the light on the wet surface."""

    strength: NonNegative = 1.0
    """brightness, linear light"""
    exponent: Positive = 150.0
    """sharpness"""


class Instrument(ActiveEffect, frozen=True, kw_only=True):
    """A grasper in front of the tissue. The mask and the prior depth exclude its pixels."""

    travel: NonNegative = 0.06
    """half the width of the path of its wrist, an ellipse of 0.6 times that height, image widths"""
    cycles: Positive = 1.0
    """cycles per sequence"""
    margin: NonNegative = 0.006
    """width of the masked border around the drawn instrument, image widths"""


class CameraMotion(Effect, frozen=True, kw_only=True):
    """The camera moves in front of the tissue; off = one Camera object for all frames."""

    path: Literal["orbit", "hand"] = "orbit"
    """orbit: around the middle of the tissue; hand: drifts, pushes in, rolls and trembles, drawn from the seed"""
    amplitude: NonNegative = 3.0
    """largest shift of the camera to the right, and down; of a hand: in the plane of the picture, mm"""
    cycles: Positive = 1.0
    """cycles per sequence; of a hand: the rate of its waves, as a factor"""


class SensorNoise(ActiveEffect, frozen=True, kw_only=True):
    """Sensor noise in the picture."""

    sigma: NonNegative = 0.01
    """standard deviation, display units [0, 1]"""


class DepthErrors(Effect, frozen=True, kw_only=True):
    """Errors of stereo matching in the prior depth. The true depth is stored separately and stays exact."""

    sigma: NonNegative = 0.5
    """standard deviation, mm"""
    strip: Fraction = 0.07
    """columns without depth at the left, image widths"""


class Cutting(Effect, frozen=True, kw_only=True):
    """A blade moves along a line. Behind it the tissue parts and exposes a wound."""

    opening: Positive = 4.0
    """largest width of the slit, mm"""
    length: Positive = 18.0
    """length of the finished slit, mm"""
    reach: Positive = 7.0
    """Gaussian radius of the displaced tissue, mm"""
    depth: NonNegative = 0.8
    """depth of the wound at its widest point, mm"""
    start: Fraction = 0.15
    """normalised time at which the blade starts"""
    stop: Fraction = 0.7
    """normalised time at which the slit has its full length and width"""


class Bleeding(Effect, frozen=True, kw_only=True):
    """Blood spreads from a spot of the tissue and covers it."""

    radius: Positive = 6.0
    """mean radius at the end of the sequence, mm"""
    opacity: Fraction = 0.9
    """fraction of the colour that blood replaces"""
    start: Fraction = 0.2
    """normalised time at which the bleeding begins"""


class Smoke(Effect, frozen=True, kw_only=True):
    """Drifting smoke between camera and tissue, which replaces a fraction of the light of a pixel with grey."""

    density: Fraction = 0.6
    """fraction of the light that the densest smoke replaces"""
    size: Positive = 0.16
    """size of the clouds, image widths"""
    drift: float = 0.5
    """drift of the clouds to the right during the sequence, image widths"""
    start: Fraction = 0.1
    """normalised time at which the smoke rises"""
    stop: Fraction = 0.95
    """normalised time at which the smoke has cleared"""


class SecondLight(Effect, frozen=True, kw_only=True):
    """A second lamp, at a fixed position near the camera of frame 0."""

    strength: NonNegative = 0.5
    """brightness, relative to the lamp at the camera"""
    right: float = -30.0
    """position to the right of the camera, mm"""
    down: float = -20.0
    """position below the camera, mm"""


class AutoExposure(Effect, frozen=True, kw_only=True):
    """The automatic exposure of the camera jumps; the gain is constant between jumps."""

    amplitude: Fraction = 0.25
    """largest difference of the gain from its first level 1, linear light"""
    steps: PositiveCount = 3
    """number of jumps, evenly spaced"""


class Vignetting(Effect, frozen=True, kw_only=True):
    """The lens darkens the picture towards its corners."""

    amplitude: Fraction = 0.4
    """fraction of the light lost in the corners"""


class MotionBlur(Effect, frozen=True, kw_only=True):
    """The picture is the mean over the exposure, which is centred on the time of the frame."""

    shutter: Fraction = 0.5
    """exposure time, as a fraction of the frame interval"""
    samples: Annotated[int, msgspec.Meta(ge=2, le=64)] = 5
    """times of the exposure that are averaged"""


class MoreInstruments(Effect, frozen=True, kw_only=True):
    """Further graspers that enter from other sides, with travel, cycles and margin of `instrument`."""

    count: Annotated[int, msgspec.Meta(ge=1, le=2)] = 1
    """number of further graspers"""


class Shadows(Effect, frozen=True, kw_only=True):
    """The instruments cast shadows of every lamp. That of the endoscope is next to the camera."""

    strength: Fraction = 0.6
    """fraction of the light of a lamp that the shadow removes"""
    offset: float = 5.0
    """position of the endoscope's lamp to the right of the camera, mm; affects the shadows only"""
    softness: NonNegative = 0.01
    """Gaussian radius of the edge of the shadow, image widths"""


class Stereo(Effect, frozen=True, kw_only=True):
    """A second camera to the right. The strip at the left that it does not see has no prior depth and is excluded."""

    baseline: Positive = 4.0
    """distance between the two cameras, mm"""


class DepthRounding(Effect, frozen=True, kw_only=True):
    """The prior depth is rounded, as in the files of a sequence folder."""

    step: Positive = 1.0
    """step, mm"""
