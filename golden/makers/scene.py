"""Family `scene`: the raw parameters at one time, with the deformation and both residuals applied.

Inputs: raw parameters, coefficients of every component and the training stamps. There is one case per time basis. They
test the normalisation of the atoms, the order of the ten offsets, and offsets before activation.
"""

from makers.making import Seeds, Spec
from makers.moving import TIME, model_settings, moving_inputs
from makers.operations import Declared, Judged

DECLARED = {
    "scene": Declared(
        {
            "position_at_t": Judged(1, "scene unit", "last", "motion.motion_forward"),
            "quaternion_at_t": Judged(1, "1", "last", "deformation.deformation_forward"),
            "log_scale_at_t": Judged(1, "1", "last", "deformation.deformation_forward"),
            "residual_at_t": Judged(1, "display / Y00", "last", "appearance.appearance_forward"),
        },
        "raw parameters at time `t`: offsets, C phi added; `residual_at_t` by (2). `model` holds the settings,"
        " statistics are over `times[train_index]`",
        equations="(1) to (3), (B1)",
    )
}
OPERATIONS = tuple(DECLARED)


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
