"""Family `scene`: the raw parameters at one time, with the deformation and both residuals applied.

Raw parameters, coefficients of every component and the training stamps come in. One case a time basis. They fix which
atoms are normalised, the order of the ten offsets, and that offsets act before activation.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.deformation import deformation_forward
from endotsr.equations.dictionary import normalised_atoms
from endotsr.equations.motion import motion_forward
from endotsr.golden.vectors.making import Seeds, Spec
from endotsr.golden.vectors.moving import TIME, model_settings, moving_inputs
from endotsr.golden.vectors.wrong import Request, WrongPort
from endotsr.stages.requests import gaussians_of, model_of, spectral_of

OPERATIONS = ("scene",)


def cases() -> list[Spec]:
    """Both time bases."""
    flags = ("motion_of_normalised_atoms", "statistics_over_all_frames", "missing_y00", "basis_swapped",
             "deformation_channels_shifted", "scale_offset_after_activation")  # fmt: skip
    out = []
    for basis in ("quartic", "gaussian"):
        inputs = moving_inputs(Seeds("scene", basis), 0, True)
        for name in ("rotation_matrix", "translation"):
            del inputs[name]
        for name in ("harmonics", "opacity_logit"):  # last in the list of inputs
            inputs[name] = inputs.pop(name)
        title = f"Every component at one time: offsets before activation, raw and normalised atoms ({basis})"
        settings = {"t": TIME, "model": model_settings(basis=basis)}
        out.append(Spec("scene", basis, "scene", title, flags, settings, inputs))
    return out


# ---- mistakes ----


def _offsets(request: Request) -> NDArray:
    g, model = gaussians_of(request.inputs), model_of(request.settings)
    assert g.fdm_weight is not None and g.fdm_centre is not None and g.fdm_width is not None
    return deformation_forward(g.fdm_weight, g.fdm_centre, g.fdm_width, request.settings["t"], model.basis)[0]


def _normalised_motion(request: Request) -> dict[str, NDArray]:
    spectral, t = spectral_of(request.inputs, request.settings), request.settings["t"]
    c = request.inputs["motion_coefficients"]
    phi_bar = normalised_atoms(t, spectral.omega, spectral.statistics).astype(c.dtype)
    moved = motion_forward(c, phi_bar)[0]
    return {"position_at_t": request.inputs["position"] + _offsets(request)[:3] + moved}


def _shifted_channels(request: Request) -> dict[str, NDArray]:
    """Quaternion last: 3-5 log-scale, 6-9 quaternion."""
    offsets = _offsets(request)
    return {
        "log_scale_at_t": request.inputs["log_scale"] + offsets[3:6],
        "quaternion_at_t": request.inputs["quaternion"] + offsets[6:10],
    }


def _after_activation(request: Request) -> dict[str, NDArray]:
    scale = np.exp(request.inputs["log_scale"]) + _offsets(request)[7:10]
    return {"log_scale_at_t": np.log(np.maximum(scale, 1e-6))}


WRONG_PORTS = [
    WrongPort("motion_of_normalised_atoms", "Motion from normalised atoms", "phi_bar; right: raw phi",
              {"scene": _normalised_motion}),
    WrongPort("deformation_channels_shifted", "Deformation channels in another order",
              "position, log-scale, quaternion; right: position, quaternion, log-scale", {"scene": _shifted_channels}),
    WrongPort("scale_offset_after_activation", "Offset added to the semi-axis", "exp(s) + psi; right: in the exponent",
              {"scene": _after_activation}),
]  # fmt: skip
