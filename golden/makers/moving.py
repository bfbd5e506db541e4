"""A moving scene with every component, for the families of the whole method."""

from typing import Any

import msgspec

from endotsr.config import ModelConfig
from makers.clock import stamps, train_index
from makers.making import Made, Seeds
from makers.settings import written_section
from makers.views import pose, scene_inputs

COUNT, BASES, FREQUENCIES, FRAMES = 12, 3, 2, 12
LENS = {"fx": 24.0, "fy": 24.0, "cx": 12.0, "cy": 10.0, "width": 25, "height": 21}
TIME = 0.3984375


def model_settings(**changes: Any) -> dict[str, Any]:
    """The model of the moving scene as settings of a case."""
    model = ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.25)
    return written_section(msgspec.structs.replace(model, **changes))


def moving_inputs(seeds: Seeds, degree: int, static: bool, frequencies: int = FREQUENCIES) -> dict[str, Made]:
    """Raw parameters of every component, all nonzero."""
    shape, atoms = (10, BASES, COUNT), 2 * frequencies
    centre = seeds.uniform("fdm_centre", 0.1, 0.7, *shape)
    return scene_inputs(seeds, COUNT, degree, pose(static)) | {
        "fdm_weight": seeds.uniform("fdm_weight", -0.08, 0.08, *shape, unit="raw parameter"),
        "fdm_centre": centre,
        "fdm_width": seeds.uniform("fdm_width", 0.25, 0.5, *shape),
        "appearance_coefficients": seeds.uniform("colour_coefficients", -0.5, 0.5, 3, atoms, COUNT),
        "motion_coefficients": seeds.uniform("motion_coefficients", -0.05, 0.05, 3, atoms, COUNT, unit="scene unit"),
        "times": stamps(FRAMES),
        "train_index": train_index(FRAMES),
    }
