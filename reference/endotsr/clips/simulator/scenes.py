"""Named scenes, from trivial to full, at the size of published clips.

In: a name, or the names of effects. Out: `SimulatorSettings` for a sequence folder: 640x512 pixels, 63 frames, with a
right picture and prior depth in whole millimetres.
"""

import msgspec

from endotsr.clips.simulator.settings import EFFECTS, SimulatorSettings, with_effects
from endotsr.errors import InputError
from endotsr.untrusted.names import choice

SIZE = SimulatorSettings(width=640, height=512, frames=63)
IN_FILES = ("stereo", "depth_rounding")  # on in every scene: required by a sequence folder
SCENES: dict[str, tuple[str, ...]] = {
    "still": ("noise",),
    "breathing": ("breathing", "pulsation", "highlights", "noise"),
    "pulling": (
        "breathing", "pulsation", "pull", "exposure", "brightening", "highlights", "instrument", "noise",
    ),
    "cutting": ("breathing", "cutting", "bleeding", "highlights", "instrument", "shadows", "noise"),
    "smoke": ("breathing", "pulsation", "smoke", "auto_exposure", "highlights", "instrument", "noise"),
    "moving-camera": ("camera_motion", "motion_blur", "vignetting", "second_light", "highlights", "noise"),
    "everything": EFFECTS,
}  # fmt: skip
"""Name -> the effects that are on, in addition to `IN_FILES`."""


def named_scene(name: str) -> SimulatorSettings:
    """The settings of a scene. Raises InputError for a name that is not in SCENES."""
    if name not in SCENES:
        raise InputError(f"scene {name!r} is not allowed; use {choice(SCENES)}")
    return with_effects(SIZE, *SCENES[name], *IN_FILES)


def scene_of(effects: str, size: SimulatorSettings = SIZE) -> SimulatorSettings:
    """A scene with the effects of a list such as "breathing,smoke" and those of `IN_FILES`; "" adds none.

    Raises:  InputError for a name that is not in EFFECTS.
    """
    return with_effects(size, *(word.strip() for word in effects.split(",") if word.strip()), *IN_FILES)


def effects_on(settings: SimulatorSettings) -> tuple[str, ...]:
    """The names of the effects that are switched on, in the order of EFFECTS."""
    return tuple(name for name in EFFECTS if msgspec.to_builtins(getattr(settings, name))["on"])
