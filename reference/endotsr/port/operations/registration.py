"""Operation of the registration of two frames (B19)."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.splatting import registration
from endotsr.method.splatting.camera import Camera
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings, Variant

ALWAYS_DOUBLE = "a residual is computed in float64, whatever the precision of its inputs"
COUNT, WIDTH, HEIGHT = 9, 14, 11
LENS = {"fx": 12.0, "fy": 13.0, "cx": 7.25, "cy": 5.25, "width": WIDTH, "height": HEIGHT}


def _registration(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    camera = Camera(np.eye(3), np.zeros(3), **settings["camera"])
    given = (inputs[name] for name in ("rotation", "translation", "points", "reference", "picture"))
    residual, saved = module.registration_forward(*given, camera)
    return {"residual": residual}, saved


def _reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return module.registration_reverse(cotangents["residual"], saved)._asdict()


def _seen(module: Any, inputs: Inputs, settings: Settings, saved: Any) -> Found:
    return {"seen": saved.seen}


def _cells(inputs: Inputs, settings: Settings, saved: Any) -> dict[str, NDArray]:
    """The pixel of every projection: the second derivative of the interpolation jumps between pixels."""
    lens = settings["camera"]
    x, y, z = inputs["rotation"] @ inputs["points"] + np.asarray(inputs["translation"])[:, None]
    column, row = np.floor(lens["fx"] * x / z + lens["cx"] - 0.5), np.floor(lens["fy"] * y / z + lens["cy"] - 0.5)
    return {"seen": saved.seen, "column": column, "row": row}


def _inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Points that project to the middle of pixels, one behind the camera and one beside the picture."""
    column, row = np.arange(COUNT) % 3 * 3 + 2.0, np.arange(COUNT) // 3 * 2 + 2.0
    place = np.stack([column, row]) + 1.0 + rng.uniform(-0.3, 0.3, (2, COUNT))
    z = rng.uniform(4.0, 6.0, COUNT)
    x, y = (place[0] - LENS["cx"]) / LENS["fx"] * z, (place[1] - LENS["cy"]) / LENS["fy"] * z
    seen = np.stack([x, y, z])
    seen[:, 0] *= -1
    seen[0, 1] += 20.0
    rotation, translation = np.eye(3) + rng.normal(0, 0.2, (3, 3)), rng.normal(0, 0.5, 3)
    return {
        "rotation": rotation,
        "translation": translation,
        "points": np.linalg.solve(rotation, seen - translation[:, None]),
        "reference": rng.normal(0, 1, COUNT),
    }


def _picture(dtype: np.dtype) -> dict[str, NDArray]:
    return {"picture": np.random.default_rng(19).normal(0, 1, (HEIGHT, WIDTH)).astype(dtype)}


OPERATIONS = [
    Operation(
        name="registration",
        equation="B19",
        text="residual of two frames registered by depth and a pose",
        function="endotsr.method.splatting.registration.registration_forward",
        forward=partial(_registration, registration),
        reverse=partial(_reverse, registration),
        extra=partial(_seen, registration),
        trace=_cells,
        variants=(Variant("registration", _inputs, {"camera": LENS}, fixed=_picture, single=ALWAYS_DOUBLE),),
    )
]
