"""Family `scene`: the raw parameters at one time, with the deformation and both residuals applied.

Raw parameters, coefficients of every component and the training stamps come in. One case a time basis. They fix which
atoms are normalised, the order of the ten offsets, and that offsets act before activation.
"""

from makers.making import Seeds, Spec
from makers.moving import TIME, model_settings, moving_inputs
from makers.wrong import edit, port

OPERATIONS = ("scene",)


def cases() -> list[Spec]:
    """Both time bases."""
    flags = ("motion_of_normalised_atoms", "statistics_over_all_frames", "missing_y00", "basis_swapped",
             "deformation_channels_shifted", "scale_offset_after_activation", "appearance_of_raw_atoms")  # fmt: skip
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

SOURCE, CHANNELS = "fitting.model", "scene.gaussians"
ALL = "scene objective training"

WRONG_PORTS = [
    port(
        "motion_of_normalised_atoms",
        "Motion from normalised atoms",
        "phi_bar; right: raw phi",
        "scene objective",
        edit(
            SOURCE,
            "phi, _ = dictionary_forward(t, spectral.omega)",
            "phi = normalised_atoms(t, spectral.omega, spectral.statistics)",
        ),
    ),
    port(
        "appearance_of_raw_atoms",
        "Colour residual from raw atoms",
        "phi; right: phi_bar",
        "scene objective",
        edit(
            SOURCE,
            "phi_bar = normalised_atoms(t, spectral.omega, spectral.statistics)",
            "phi_bar, _ = dictionary_forward(t, spectral.omega)",
        ),
    ),
    port(
        "deformation_channels_shifted",
        "Deformation channels in another order",
        "position, log-scale, quaternion; right: position, quaternion, log-scale",
        "scene objective",
        edit(
            SOURCE,
            "quaternion + offsets[QUATERNION_CHANNELS], log_scale + offsets[LOG_SCALE_CHANNELS]",
            "quaternion + offsets[6:10], log_scale + offsets[3:6]",
        ),
        edit(
            SOURCE,
            "[grads.d_position, grads.d_quaternion, grads.d_log_scale]",
            "[grads.d_position, grads.d_log_scale, grads.d_quaternion]",
        ),
    ),
    port(
        "scale_offset_after_activation",
        "Offset added to the semi-axis",
        "exp(s) + psi; right: in the exponent",
        "scene",
        edit(
            SOURCE,
            "log_scale + offsets[LOG_SCALE_CHANNELS]",
            "np.log(np.maximum(np.exp(log_scale) + offsets[LOG_SCALE_CHANNELS], 1e-6))",
        ),
    ),
]
