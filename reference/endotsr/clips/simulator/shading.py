"""Linear light from geometry and reflectance: lamps with fall-off, brightening tissue, blood, the wound, highlights.

In: a `SurfaceView` of the sheet, its texture, the lamps on it, the time. Out: linear RGB light from the tissue.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.bleeding import with_blood
from endotsr.clips.simulator.lamps import Blocker, Lit, bent_normal, lit_by_endoscope, lit_by_second, mirrored
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.surface import gaussian_weight
from endotsr.clips.simulator.texture import Texture, sample
from endotsr.clips.simulator.views import SurfaceView
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera

BLOCK_ROWS = 32  # rows shaded together, so that the arrays between the steps are small
WOUND = np.array([0.30, 0.020, 0.018])  # linear reflectance of inner tissue


class TissueLight(NamedTuple):
    """Linear light from the tissue."""

    light: FloatArray  # (3, H, W) including highlights
    highlight: FloatArray | None  # (H, W) the highlights alone, white; None if they are off


def lit_by_all(
    settings: SimulatorSettings,
    view: SurfaceView,
    camera: Camera,
    blocker: Blocker | None = None,
    eye: Camera | None = None,
) -> list[Lit]:
    """The active lamps, starting with the lamp at the camera. `eye` is the camera of the view, if it differs."""
    lamps = [lit_by_endoscope(settings, view, camera, blocker, eye)]
    if settings.second_light.on:
        lamps.append(lit_by_second(settings, view, blocker, eye or camera))
    return lamps


def shade(settings: SimulatorSettings, texture: Texture, view: SurfaceView, lamps: list[Lit], t: float) -> TissueLight:
    """Linear light from the tissue, before exposure.

    A lamp gives reflectance * received * max(n.l + WRAP, 0) / (1 + WRAP), times the brightening of the tissue, plus a
    highlight strength * received * max(n'.half, 0)^exponent, summed over the lamps. received is GAIN (distance / r)^2,
    for the lamp at the camera times (depth / r)^BEAM, for the second one times its strength, and less the shadows. l
    points to a lamp at distance r, half is half-way between lamp and camera, and n' is the normal of the fine relief.
    `BLOCK_ROWS` rows are shaded together.
    """
    parts = []
    for top in range(0, view.material.shape[1], BLOCK_ROWS):
        rows = slice(top, top + BLOCK_ROWS)
        some = [Lit(lamp.diffuse[rows], lamp.received[rows], lamp.half[:, rows]) for lamp in lamps]
        parts.append(_shade_rows(settings, texture, _rows_of(view, rows), some, t))
    light = np.concatenate([part.light for part in parts], axis=1)
    if not settings.highlights.on:
        return TissueLight(light, None)
    return TissueLight(light, np.concatenate([part.highlight for part in parts if part.highlight is not None]))


def _rows_of(view: SurfaceView, rows: slice) -> SurfaceView:
    """Some rows of a view."""
    wound = None if view.wound is None else view.wound[rows]
    return SurfaceView(view.material[:, rows], view.point[:, rows], view.normal[:, rows], view.depth[rows], wound)


def _shade_rows(
    settings: SimulatorSettings, texture: Texture, view: SurfaceView, lamps: list[Lit], t: float
) -> TissueLight:
    """As `shade`, for some rows."""
    maps = sample(texture, view.material)
    reflectance = maps[:3]
    if view.wound is not None:
        reflectance = np.where(view.wound, WOUND[:, None, None], reflectance)
    if settings.bleeding.on:
        reflectance = with_blood(settings, reflectance, view.material, t)
    light = reflectance * (lamps[0].diffuse if len(lamps) == 1 else lamps[0].diffuse + lamps[1].diffuse)
    if settings.brightening.on:
        light = light * _brightening(settings, view.material, t)
    if not settings.highlights.on:
        return TissueLight(light, None)
    bent = bent_normal(view.normal, maps[3:])
    highlight = mirrored(settings, lamps[0], bent)
    for lamp in lamps[1:]:
        highlight = highlight + mirrored(settings, lamp, bent)
    return TissueLight(light + highlight, highlight)


def _brightening(settings: SimulatorSettings, material: FloatArray, t: float) -> FloatArray:
    part = settings.brightening
    centre = (-0.14 * settings.distance, -0.12 * settings.distance)
    weight = gaussian_weight(centre, part.width)(material[0], material[1])[0]
    return 1 + part.amplitude * np.sin(np.pi * part.cycles * t) ** 2 * weight
