"""Family `harmonics`: the colour of a Gaussian (B4) from harmonics of degree 0 to 3 and its residual.

Coefficients, residual, position, optical centre and a gradient by the colour come in. The cases fix the signs and the
order of the coefficients, the clamp at 0 (none at 1), the gradient through the view direction, and a Gaussian at the
optical centre, which has no direction.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Seeds, Spec, changed
from endotsr.golden.vectors.wrong import Request, WrongPort, output, swapped
from endotsr.kernels.constants import Y00

OPERATIONS = ("harmonics",)


def _degree(degree: int) -> Spec:
    seeds = Seeds("harmonics", f"degree_{degree}")
    coefficients = seeds.uniform("harmonics", -0.4, 0.6, (degree + 1) ** 2, 3, 9)
    coefficients = changed(coefficients, (0, slice(None), slice(None, None, 3)), -4.0, "[0, :, ::3] is -4: clamped")
    coefficients = changed(coefficients, (0, 1, slice(1, None, 3)), 4.0, "[0, 1, 1::3] is 4: above 1")
    inputs = {
        "harmonics": coefficients,
        "residual": seeds.uniform("residual", -0.3, 0.3, 3, 9),
        "position": seeds.uniform("position", -2.0, 2.0, 3, 9, unit="scene unit"),
        "centre": seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit"),
        "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 9),
    }
    flags = ["colour_not_clamped", "colour_clamped_above", "offset_half_missing", "residual_not_scaled"]
    if degree > 0:
        flags += ["harmonics_sign_y", "direction_gradient_dropped", "direction_inverted", "bands_channel_first"]
    title = f"Real harmonics of degree {degree}; residual on the first coefficient, clamp at 0, none above"
    return Spec("harmonics", f"degree_{degree}", "harmonics", title, tuple(flags), {"degree": degree}, inputs)


def _at_the_camera() -> Spec:
    seeds = Seeds("harmonics", "at_the_camera")
    centre = seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit")
    position = seeds.uniform("position", -2.0, 2.0, 3, 4, unit="scene unit")
    inputs = {
        "harmonics": seeds.uniform("harmonics", -0.4, 0.6, 9, 3, 4),
        "residual": seeds.uniform("residual", -0.3, 0.3, 3, 4),
        "position": changed(position, (slice(None), 1), centre.array, "Gaussian 1 is at the optical centre"),
        "centre": centre,
        "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 4),
    }
    return Spec("harmonics", "at_the_camera", "harmonics", "A Gaussian at the optical centre: the first band only",
                ("direction_of_nothing",), {"degree": 2}, inputs, ("position", "centre"), own=("colour",))  # fmt: skip


def cases() -> list[Spec]:
    """Every degree, and a Gaussian without a direction."""
    return [*(_degree(degree) for degree in range(4)), _at_the_camera()]


# ---- mistakes ----


def _unclamped(request: Request) -> dict[str, NDArray]:
    """No clamp at 0: the same with 8 added to the first coefficient, and the 8 taken out again."""
    lifted = request.inputs["harmonics"].copy()
    lifted[0] += 8.0
    found = request.run(dict(request.inputs) | {"harmonics": lifted}, request.settings)
    return found | {"colour": found["colour"] - 8.0 * Y00}


def _no_half(request: Request) -> dict[str, NDArray]:
    lowered = request.inputs["harmonics"].copy()
    lowered[0] -= 0.5 / Y00
    return request.run(dict(request.inputs) | {"harmonics": lowered}, request.settings)


def _bands(request: Request) -> dict[str, NDArray] | None:
    h = request.inputs["harmonics"]
    if h.shape[0] == 1:
        return None
    wrong = np.ascontiguousarray(h.reshape(3, h.shape[0], -1).transpose(1, 0, 2))
    return request.run(dict(request.inputs) | {"harmonics": wrong}, request.settings)


def _mirrored(request: Request) -> dict[str, NDArray] | None:
    h = request.inputs["harmonics"].copy()
    if h.shape[0] < 4:
        return None
    h[1] *= -1
    return {"colour": request.run(dict(request.inputs) | {"harmonics": h}, request.settings)["colour"]}


def _inverted_direction(request: Request) -> dict[str, NDArray] | None:
    if request.settings["degree"] == 0:
        return None
    swap = {"position": np.tile(request.inputs["centre"][:, None], request.inputs["position"].shape[1])}
    mirrored = 2 * swap["position"] - request.inputs["position"]
    found = request.run(dict(request.inputs) | {"position": mirrored}, request.settings)
    return {"colour": found["colour"], "d_harmonics": found["d_harmonics"]}


def _nowhere(request: Request) -> dict[str, NDArray] | None:
    """The direction 0 / 0."""
    at = (request.inputs["position"] == request.inputs["centre"][:, None]).all(axis=0)
    if not at.any() or request.settings["degree"] == 0:
        return None
    names = ("colour", "d_position")
    return {name: np.where(at, np.nan, request.right[name]) for name in names}


WRONG_PORTS = [
    WrongPort("harmonics_sign_y", "Sign of the first harmonic", "+y; right: -y", {"harmonics": _mirrored}),
    WrongPort("direction_inverted", "Direction from Gaussian to camera", "inverted; right: camera to Gaussian",
              {"harmonics": _inverted_direction}),
    WrongPort("direction_gradient_dropped", "No gradient through the view direction", "0; right: kept",
              {"harmonics": lambda r: {n: 0 * r.right[n] for n in ("d_position", "d_centre")}
               if r.settings["degree"] else None}),
    WrongPort("bands_channel_first", "Harmonics as [channel, band]", "(3, K); right: (K, 3)", {"harmonics": _bands}),
    WrongPort("colour_not_clamped", "Colour not clamped at 0", "negative colours; right: max(0, .)",
              {"harmonics": _unclamped}),
    WrongPort("colour_clamped_above", "Colour clamped at 1", "min(1, .); right: no upper clamp",
              {"harmonics": output(colour=lambda a: np.minimum(a, 1.0))}),
    WrongPort("offset_half_missing", "1/2 left out of the colour", "sum Y h; right: 1/2 + sum Y h",
              {"harmonics": _no_half}),
    WrongPort("residual_not_scaled", "Residual added to the colour", "colour + r; right: Y00 (h_0 + r)",
              {"harmonics": swapped(lambda i: {"residual": i["residual"] / i["residual"].dtype.type(Y00)})}),
    WrongPort("direction_of_nothing", "Direction to a Gaussian at the optical centre", "0 / 0; right: first band only",
              {"harmonics": _nowhere}),
]  # fmt: skip
