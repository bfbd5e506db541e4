"""Settings of the rasteriser: three named presets; every field can also be set individually."""

from typing import Literal, NamedTuple

Support = Literal["everywhere", "ellipse", "three_sigma_tiles"]


class LegacyDeviations(NamedTuple):
    """Deviations of the released CUDA code from the exact gradient, each with its own switch (all off = exact)."""

    drop_depth_to_z: bool = False  # no gradient from the depth image to z
    pass_clamped_alpha: bool = False  # gradient passes through the alpha clamp
    double_clamp_term: bool = False  # factor 2 instead of 1 in d(Jacobian)/dz where the off-axis clamp is active
    conic_epsilon: bool = False  # 1/(det^2 + 1e-7) instead of 1/det^2 in d(a, b, c)


class RasterSettings(NamedTuple):
    """Support, thresholds and near plane of the rasteriser. The specification tabulates the presets."""

    alpha_cutoff: float = 1.0 / 255.0  # a smaller alpha contributes nothing; 0 = no cutoff
    transmittance_stop: float = 1e-4  # stop before T falls below this; 0 = never
    alpha_max: float = 0.99  # clamp of alpha; 1 = none
    support: Support = "ellipse"
    jacobian_clamp: float = 1.3  # times tan(fov/2); 0 = none
    low_pass: float = 0.3  # px^2 on the diagonal of the projected covariance
    near: float = 0.2  # scene units; z <= near contributes nothing
    deviations: LegacyDeviations = LegacyDeviations()


EXACT = RasterSettings(
    alpha_cutoff=0.0, transmittance_stop=0.0, alpha_max=1.0, support="everywhere", jacobian_clamp=0.0
)
PAPER = RasterSettings()
LEGACY = RasterSettings(support="three_sigma_tiles", deviations=LegacyDeviations(True, True, True, True))
PRESETS = {"exact": EXACT, "paper": PAPER, "legacy": LEGACY}
