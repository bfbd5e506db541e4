"""The numbers of the method: the presets of the rasteriser, and the settings of `paper` by section."""

from collections import namedtuple

LegacyDeviations = namedtuple(
    "LegacyDeviations", "drop_depth_to_z pass_clamped_alpha double_clamp_term conic_epsilon", defaults=[False] * 4
)
RasterSettings = namedtuple(
    "RasterSettings", "alpha_cutoff transmittance_stop alpha_max support jacobian_clamp low_pass near deviations"
)
PAPER = RasterSettings(1 / 255, 1e-4, 0.99, "ellipse", 1.3, 0.3, 0.2, LegacyDeviations())
EXACT = RasterSettings(0.0, 0.0, 1.0, "everywhere", 0.0, 0.3, 0.2, LegacyDeviations())
LEGACY = PAPER._replace(support="three_sigma_tiles", deviations=LegacyDeviations(*[True] * 4))

Config = namedtuple("Config", "model loss optimiser density initialisation training")
section = lambda **values: namedtuple("Section", values)(**values)  # settings by name

PAPER_CONFIG = Config(
    model=section(
        appearance=True, spectral_motion=True, laplacian=True, deformation=True, exposure=False, basis="quartic",
        bases=17, initial_width=0.01, harmonics_degree=3, frequencies=8, frequency_min=1.0, frequency_max=16.0,
        beta=0.3, correlation_length=0.2,
    ),
    loss=section(
        ssim_weight=0.1, depth_weight=1.0, smoothness_weight=1e-4, total_variation_factor=30.0, smoothness_from=1001,
        lambda_msp=1.0, lambda_lap=0.83, laplacian_from=1000, laplacian_full=2500, upsampling="co_sited",
        gradient_ratio=0.25, calibration_views=16,
    ),
    optimiser=section(
        position=1.6e-3, deformation=1.6e-3, deformation_position_factor=1.0, harmonics_base=2.5e-3,
        harmonics_rest=1.25e-4, opacity=0.05, scale=0.005, rotation=0.001, exposure=1e-3,
        spectral_motion_factor=0.1, appearance_factor=31.25 / 16, final_factor=0.01, annealed_factor=1.0,
        annealing_from=4500, restart_residual_schedule=True, beta1=0.9, beta2=0.999, epsilon=1e-15, legacy_skip=False,
    ),
    density=section(
        start=500, interval=100, until=4000, growth="threshold", gradient_threshold=2e-4, extent=10.0,
        dense_fraction=0.01, prune_opacity=0.005, maximum=400_000,
    ),
    initialisation=section(first_frame_points=35_000, other_frame_points=5_000, motion_threshold=40.0),
    training=section(iterations=6000, residual_activation=3000, harmonics_interval=500),
)  # fmt: skip
# The same, shortened for the scene of `simulate`.
SMALL = PAPER_CONFIG._replace(
    model=PAPER_CONFIG.model._replace(bases=9, initial_width=0.1, frequencies=4, frequency_max=4.0),
    loss=PAPER_CONFIG.loss._replace(smoothness_from=60, laplacian_from=50, laplacian_full=100),
    density=PAPER_CONFIG.density._replace(start=20, interval=40, until=140, gradient_threshold=1e-2, maximum=300),
    initialisation=section(first_frame_points=150, other_frame_points=64, motion_threshold=0.1),
    training=section(iterations=300, residual_activation=100, harmonics_interval=60),
)
