"""Checks that the effects of a scene stay in the picture, before anything is rendered or written.

In: settings. Out: nothing, or an `InputError` that names the excessive setting and its largest allowed value, or what
helps if no setting alone is excessive. Every frame is checked, on a grid of rays and at the central points of each
effect; of bleeding, on the circle of its mean radius, which its lobes exceed.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np

from endotsr.clips.sequences.times import time_stamps
from endotsr.clips.simulator.bleeding import CENTRE as BLOOD_CENTRE
from endotsr.clips.simulator.cameras import make_cameras
from endotsr.clips.simulator.instrument import graspers, wrist_at
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.slit import make_slit
from endotsr.clips.simulator.surface import PULL_CENTRE, PULSATION_CENTRE, make_surface, surface_point
from endotsr.clips.simulator.texture import half_extent
from endotsr.clips.simulator.views import pixel_of, see_rays
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

GRID = (9, 8)  # rays across and down the picture
SMALLEST = 1e-6  # a size at which an effect has no extent
HALVINGS = 16  # bisection steps for the largest allowed value

Fits = Callable[[SimulatorSettings], bool]
Points = Callable[[SimulatorSettings], FloatArray]


def check_field_of_view(settings: SimulatorSettings) -> None:
    """Raises InputError if an effect leaves the picture or the camera sees beyond the simulated tissue."""
    for needed in _requirements(settings):
        _require(needed, settings)


class Requirement(NamedTuple):
    """A condition, the sizes (section, key) that may violate it, and what helps if none of them does alone."""

    fits: Fits
    sizes: list[tuple[str, str]]
    remedy: str = "a smaller focal"


def _requirements(settings: SimulatorSettings) -> list[Requirement]:
    moving = [(name, "amplitude") for name in ("camera_motion", "pull", "pulsation", "breathing")]
    effects = [
        Requirement(partial(_points_fit, points=points), [(section, key), *moving])
        for section, (key, points) in ABOUT.items()
        if getattr(settings, section).on
    ]
    wrists = Requirement(_wrists_fit, [("instrument", "travel")], "fewer instruments")
    return [*effects, wrists, Requirement(_tissue_fits, moving, "a larger focal, a smaller relief")]


def _all_fit(settings: SimulatorSettings) -> bool:
    return all(needed.fits(settings) for needed in _requirements(settings))


def _require(needed: Requirement, settings: SimulatorSettings) -> None:
    """Raises InputError if the condition fails, naming the first size (section, key) whose removal satisfies it."""
    if needed.fits(settings):
        return
    for section, key in needed.sizes:
        without = _changed(settings, section, key, SMALLEST)
        if needed.fits(without):
            raise _refusal(settings, section, key, _all_fit if _all_fit(without) else needed.fits)
    tried = dict.fromkeys(f"{section}.{key}" for section, key in needed.sizes if getattr(settings, section).on)
    smaller = f", or smaller {', '.join(tried)}" if tried else ""
    raise InputError(f"simulator: the scene leaves the field of view; use {needed.remedy}{smaller}")


def _slit_ends(settings: SimulatorSettings) -> FloatArray:
    slit = make_slit(settings)
    return slit.centre[:, None] + 0.5 * slit.length * np.outer(slit.along, [-1.0, 1.0])


def _blood_rim(settings: SimulatorSettings) -> FloatArray:
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    rim = settings.bleeding.radius * np.stack([np.cos(angle), np.sin(angle)])
    return settings.distance * np.array(BLOOD_CENTRE)[:, None] + rim


# Section -> the key of its size, and its central material points (2, P), mm.
ABOUT: dict[str, tuple[str, Points]] = {
    "breathing": ("amplitude", lambda settings: np.zeros((2, 1))),
    "pulsation": ("amplitude", lambda settings: settings.distance * np.array(PULSATION_CENTRE)[:, None]),
    "pull": ("amplitude", lambda settings: settings.distance * np.array(PULL_CENTRE)[:, None]),
    "cutting": ("length", _slit_ends),
    "bleeding": ("radius", _blood_rim),
}


def _points_fit(settings: SimulatorSettings, points: Points) -> bool:
    """Whether the material points are in the picture in every frame."""
    surface, times = make_surface(settings), time_stamps(settings.frames)
    for camera, t in zip(make_cameras(settings, times), times):
        u, v, z = pixel_of(camera, surface_point(surface, points(settings), float(t)))
        if z.min() <= 0 or min(u.min(), v.min(), camera.width - u.max(), camera.height - v.max()) < 0:
            return False
    return True


def _wrists_fit(settings: SimulatorSettings) -> bool:
    far = np.array([1.0, settings.height / settings.width])
    wrists = [wrist_at(settings, one, float(t)) for one in graspers(settings) for t in time_stamps(settings.frames)]
    return all((wrist >= 0).all() and (wrist <= far).all() for wrist in wrists)


def _tissue_fits(settings: SimulatorSettings) -> bool:
    """Whether every ray of the grid meets textured tissue in every frame."""
    surface, times = make_surface(settings), time_stamps(settings.frames)
    extent = np.array(half_extent(settings))
    for camera, t in zip(make_cameras(settings, times), times):
        x = (np.linspace(0, camera.width, GRID[0]) - camera.cx) / camera.fx
        y = (np.linspace(0, camera.height, GRID[1]) - camera.cy) / camera.fy
        try:
            a, b = see_rays(surface, camera, float(t), *np.meshgrid(x, y)).material
        except InputError:
            return False
        if np.abs(a).max() > extent[0] or np.abs(b).max() > extent[1]:
            return False
    return True


def _changed(settings: SimulatorSettings, section: str, key: str, value: float) -> SimulatorSettings:
    part = msgspec.structs.replace(getattr(settings, section), **{key: value})
    return msgspec.structs.replace(settings, **{section: part})


def _refusal(settings: SimulatorSettings, section: str, key: str, fits: Fits) -> InputError:
    """The error with the setting, its value, and the largest value that fits, found by bisection."""
    value = getattr(getattr(settings, section), key)
    low, high = SMALLEST, value
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(_changed(settings, section, key, middle)) else (low, middle)
    largest = np.floor(low * 100) / 100
    found = f"simulator: {section}.{key} = {value:g} leaves the field of view, or folds the tissue"
    return InputError(f"{found}; use at most {largest:g}")
