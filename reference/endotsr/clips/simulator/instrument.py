"""Graspers between camera and tissue, drawn in the image plane, with shaft, wrist and two jaws.

In: settings and time. Out: linear light, coverage, and the pixels that the mask excludes.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.cameras import open_span, shutter_times
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import BoolArray, FloatArray

SHAFT, WRIST, JAW = 0.042, 0.036, 0.017  # half widths, in image widths
JAW_LENGTH = 0.105
METAL = np.array([0.42, 0.43, 0.45])  # linear light
SLEEVE = np.array([0.045, 0.045, 0.05])


class Grasper(NamedTuple):
    """The path of one instrument, in image widths of a picture with height / width = 0.8."""

    entry: FloatArray  # the end of the shaft, outside the picture
    home: FloatArray  # the wrist, at t = 0
    phase: float  # of its elliptic path, radians


FIRST = Grasper(np.array([1.12, 0.78]), np.array([0.70, 0.52]), 0.0)
FURTHER = (
    Grasper(np.array([-0.12, 0.74]), np.array([0.27, 0.60]), 2.1),
    Grasper(np.array([0.86, -0.12]), np.array([0.78, 0.17]), 4.0),
)


class Drawing(NamedTuple):
    """Instruments in one frame."""

    light: FloatArray  # (3, H, W) linear RGB
    coverage: FloatArray  # (H, W)    0 .. 1, anti-aliased over one pixel
    excluded: BoolArray  # (H, W) instrument and margin


class PlacedGrasper(NamedTuple):
    """One instrument at one time, in image widths."""

    points: FloatArray  # (2, 4) entry, wrist and the two tips
    segments: list[tuple[FloatArray, FloatArray, float, FloatArray]]  # start, end, half width, colour


def graspers(settings: SimulatorSettings) -> tuple[Grasper, ...]:
    """The instruments that are switched on."""
    first = (FIRST,) if settings.instrument.on else ()
    return first + (FURTHER[: settings.more_instruments.count] if settings.more_instruments.on else ())


def draw(settings: SimulatorSettings, t: float, shift: float = 0.0) -> Drawing | None:
    """All instruments at time t, composited and motion-blurred; None without any.

    shift    to the right, in image widths, for the view of another camera
    """
    together: Drawing | None = None
    for grasper in graspers(settings):
        one = _blurred(settings, grasper, t, shift)
        together = one if together is None else _over(one, together)
    return together


def wrist_at(settings: SimulatorSettings, grasper: Grasper, t: float) -> FloatArray:
    """The wrist of an instrument at time t, in image widths, x first."""
    part = settings.instrument
    angle = 2 * np.pi * part.cycles * t + grasper.phase
    turned = np.array([np.cos(angle) - np.cos(grasper.phase), 0.6 * (np.sin(angle) - np.sin(grasper.phase))])
    return grasper.home * _aspect(settings) + part.travel * turned


def _aspect(settings: SimulatorSettings) -> FloatArray:
    """The scaling from a picture with height / width = 0.8 to this one."""
    return np.array([1.0, settings.height / settings.width / 0.8])


def _blurred(settings: SimulatorSettings, grasper: Grasper, t: float, shift: float) -> Drawing:
    """One instrument, averaged over the exposure. Only its bounding box is computed."""
    times = [t] if open_span(settings) == 0.0 else [float(t + u) for u in shutter_times(settings)]
    poses = [_pose(settings, grasper, one, shift) for one in times]
    box = _box(settings, np.concatenate([pose.points for pose in poses], axis=1))
    parts = [_draw_one(settings, pose, box) for pose in poses]
    inner = parts[0]
    if len(parts) > 1:
        coverage = np.asarray(sum(part.coverage for part in parts)) / len(parts)
        light = np.asarray(sum(part.light * part.coverage for part in parts)) / len(parts)
        excluded = np.logical_or.reduce([part.excluded for part in parts])
        inner = Drawing(_unmixed(light, coverage), coverage, excluded)
    whole = (settings.height, settings.width)
    drawing = Drawing(np.zeros((3, *whole)), np.zeros(whole), np.zeros(whole, bool))
    drawing.light[:, *box], drawing.coverage[box], drawing.excluded[box] = inner
    return drawing


def _over(front: Drawing, behind: Drawing) -> Drawing:
    """One drawing in front of another."""
    rest = behind.coverage * (1 - front.coverage)
    coverage = front.coverage + rest
    light = front.light * front.coverage + behind.light * rest
    return Drawing(_unmixed(light, coverage), coverage, front.excluded | behind.excluded)


def _unmixed(light: FloatArray, coverage: FloatArray) -> FloatArray:
    """The light of the instrument alone, divided by the coverage, which later blends it with the tissue."""
    return np.divide(light, coverage, out=np.zeros_like(light), where=coverage > 0)


def _pose(settings: SimulatorSettings, grasper: Grasper, t: float, shift: float) -> PlacedGrasper:
    """The parts of an instrument at one time."""
    angle = 2 * np.pi * settings.instrument.cycles * t + grasper.phase
    wrist = wrist_at(settings, grasper, t) + [shift, 0.0]
    entry = grasper.entry * _aspect(settings) + [shift, 0.0]
    along = (wrist - entry) / np.linalg.norm(wrist - entry)
    open_angle = 0.28 + 0.14 * np.cos(angle)
    grip = wrist + along * 0.05
    tips = [grip + JAW_LENGTH * _turned(along, side * open_angle) for side in (1, -1)]
    segments = [
        (entry, wrist - along * 0.07, SHAFT, SLEEVE),
        (wrist - along * 0.07, grip, WRIST, METAL),
        (grip, tips[0], JAW, METAL * 1.1),
        (grip, tips[1], JAW, METAL * 0.9),
    ]
    return PlacedGrasper(np.stack([entry, wrist, *tips], axis=1), segments)


def _draw_one(settings: SimulatorSettings, pose: PlacedGrasper, box: tuple[slice, slice]) -> Drawing:
    """One instrument at one time, inside a box of the picture."""
    pixel = 1.0 / settings.width
    x, y = np.meshgrid(
        ((np.arange(settings.width) + 0.5) / settings.width)[box[1]],
        ((np.arange(settings.height) + 0.5) / settings.width)[box[0]],
    )
    light, coverage = np.zeros((3, *x.shape)), np.zeros(x.shape)
    outline = np.full_like(coverage, np.inf)
    for start, end, half_width, colour in pose.segments:
        near = _within(box, _box(settings, np.stack([start, end], axis=1)))  # a segment has no effect farther away
        distance, side = _segment(x[near], y[near], start, end)
        cover = np.clip(0.5 - (distance - half_width) / pixel, 0.0, 1.0)
        on = cover > 0
        sheen = np.zeros_like(cover)
        sheen[on] = _sheen(side[on] / half_width) * cover[on]
        light[:, *near] = light[:, *near] * (1 - cover) + colour[:, None, None] * sheen
        coverage[near] = cover + coverage[near] * (1 - cover)
        outline[near] = np.minimum(outline[near], distance - half_width)
    return Drawing(_unmixed(light, coverage), coverage, outline < settings.instrument.margin + pixel)


def _within(box: tuple[slice, slice], inner: tuple[slice, slice]) -> tuple[slice, slice]:
    """The intersection of two boxes of the picture, relative to the corner of the first."""
    starts = [max(one.start - whole.start, 0) for whole, one in zip(box, inner)]
    stops = [max(min(one.stop, whole.stop) - whole.start, 0) for whole, one in zip(box, inner)]
    return slice(starts[0], stops[0]), slice(starts[1], stops[1])


def _box(settings: SimulatorSettings, points: FloatArray) -> tuple[slice, slice]:
    """Rows and columns of the picture around points (2, P), in image widths, padded for instrument and margin."""
    border = SHAFT + settings.instrument.margin + 3 / settings.width
    low = np.floor((points.min(axis=1) - border) * settings.width).astype(int)
    high = np.ceil((points.max(axis=1) + border) * settings.width).astype(int)
    (left, top), (right, bottom) = np.maximum(low, 0), np.maximum(high, 0)
    return slice(int(top), int(bottom)), slice(int(left), int(right))


def _segment(x: FloatArray, y: FloatArray, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance of every pixel from a segment, and the signed distance from its line."""
    axis = end - start
    length = np.linalg.norm(axis)
    axis = axis / length
    dx, dy = x - start[0], y - start[1]
    along = np.clip(dx * axis[0] + dy * axis[1], 0.0, length)
    distance = np.hypot(dx - along * axis[0], dy - along * axis[1])
    return distance, dx * axis[1] - dy * axis[0]


def _sheen(side: FloatArray) -> FloatArray:
    """Brightness across a round, polished bar, side in [-1, 1]."""
    profile = np.sqrt(np.clip(1 - side**2, 0.0, 1.0))
    line = np.exp(-(((side - 0.25) / 0.16) ** 2))  # the mirror image of the lamp, to one side of the middle
    return 0.25 + 0.6 * profile + 1.2 * line


def _turned(vector: FloatArray, angle: float) -> FloatArray:
    return np.array(
        [np.cos(angle) * vector[0] - np.sin(angle) * vector[1], np.sin(angle) * vector[0] + np.cos(angle) * vector[1]]
    )
