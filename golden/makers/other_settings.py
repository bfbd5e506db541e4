"""Cases of several families with settings that differ from the published ones.

A port that reads a setting passes them; a port with the published value in its code does not. `hard_coded` verifies
that every setting has two values in the cases, and that no fixed value passes.
"""

from typing import Any

import msgspec
import numpy as np

from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    RasterConfig,
    TrainingConfig,
)
from endotsr.method.splatting.settings import LEGACY, PAPER, LegacyDeviations, RasterSettings
from endotsr.port.operations.requests import raster_dict
from makers.initialisation import LENS as SMALL_LENS
from makers.initialisation import frames
from makers.making import Made, Seeds, Spec, changed, given
from makers.moving import BASES, FRAMES, LENS, moving_inputs
from makers.objective import image_inputs
from makers.screens import raster_settings, screen_inputs
from makers.settings import OF_THE_INITIALISATION, written, written_section
from makers.training import trajectory_inputs
from makers.views import cotangents, lens_settings, pose, scene_inputs, seen_at, shape_inputs, spread_points

OPERATIONS = (
    "frequencies", "appearance", "calibration", "adam", "projection", "composite", "render", "schedule",
    "initialisation", "scene", "objective", "training",
)  # fmt: skip

RASTER = PAPER._replace(
    alpha_cutoff=0.03, transmittance_stop=0.02, alpha_max=0.8, jacobian_clamp=0.75, low_pass=0.7, near=3.6
)
LOOSE = LEGACY._replace(
    near=0.0625, deviations=LegacyDeviations(drop_depth_to_z=True, double_clamp_term=True, conic_epsilon=False)
)
MODEL = {"frequencies": 3, "frequency_min": 1.5, "frequency_max": 5.0, "beta": 0.125, "correlation_length": 0.05,
         "basis": "gaussian", "bases": BASES, "initial_width": 0.1}  # fmt: skip
CASE = "other_settings"
TITLE = "Settings that are not the published ones"


def _operations() -> list[Spec]:
    """One operation each."""
    colour, views, steps = Seeds("appearance", CASE), Seeds("calibration", CASE), Seeds("adam", CASE)
    gradients = {
        name: views.uniform(name, -1.0, 1.0, 3, 3, 3, 4, unit="loss per display unit")
        for name in ("d_photometric", "d_laplacian")
    }
    slopes = steps.uniform("gradients", -1.0, 1.0, 3, 4, 5)
    return [
        Spec("frequencies", CASE, "frequencies", TITLE, (), {"count": 5, "low": 0.75, "high": 6.0}, {}),
        Spec("appearance", CASE, "appearance", TITLE, (), {"beta": 0.125}, {
            "appearance_coefficients": colour.uniform("colour_coefficients", -0.4, 0.4, 3, 6, 7),
            "phi_bar": colour.uniform("phi_bar", -1.5, 1.5, 6),
            "d_residual": colour.uniform("d_residual", -1.0, 1.0, 3, 7),
        }),
        Spec("calibration", CASE, "calibration", TITLE, (), {"gradient_ratio": 0.4}, gradients),
        Spec("adam", CASE, "adam", TITLE, ("adam_epsilon_before_correction",),
             {"rate": 0.02, "beta1": 0.75, "beta2": 0.9375, "epsilon": 0.03125},
             {"parameter": steps.uniform("parameter", -1.0, 1.0, 4, 5), "gradients": slopes}),
    ]  # fmt: skip


def _tiny(case: str, raster: RasterSettings) -> Spec:
    """Gaussians of 0.1 px without a low-pass: terms added to their determinants are visible."""
    seeds = Seeds("composite", case)
    inputs = screen_inputs(seeds, 4, 0.03, 0.05)
    middles = given([[2.625, 6.5, 9.375, 13.5], [3.5, 9.625, 5.375, 10.5]], "beside pixel centres", "px")
    title = (
        f"Determinants of a thousandth of a px^4, conic_epsilon {'on' if raster.deviations.conic_epsilon else 'off'}"
    )
    return Spec("composite", case, "composite", title, (), raster_settings(raster), inputs | {"mean2d": middles})


def _splatting() -> list[Spec]:
    """Projection, compositing and render with every field of the rasteriser changed, and two deviations of `legacy`."""
    seeds, cast = Seeds("projection", CASE), pose()
    points = spread_points(seeds, 12)
    points[0, :2] = points[2, :2] * [0.6, -0.5]
    points[1, 2:4] = points[2, 2:4] * [0.4, -0.4]
    inputs = shape_inputs(seeds, 12) | {"position": seen_at(points, cast)} | cast
    view = Seeds("render", CASE)
    scene = scene_inputs(view, 12, 2, pose()) | cotangents(view)
    scene |= {"residual": view.uniform("residual", -0.2, 0.2, 3, 12)}
    logit = scene["opacity_logit"]
    scene["opacity_logit"] = changed(logit, ..., logit.array + 1.0, "plus 1")
    part, loose = Seeds("composite", CASE), Seeds("render", "some_deviations")
    other = scene_inputs(loose, 12, 1, pose()) | cotangents(loose)
    other |= {"residual": loose.uniform("residual", -0.2, 0.2, 3, 12)}
    return [
        Spec("projection", CASE, "projection", TITLE, (), lens_settings(RASTER), inputs),
        Spec("composite", CASE, "composite", TITLE, (), raster_settings(RASTER), screen_inputs(part, 8, 4.0, 90.0)),
        _tiny("tiny_legacy", LEGACY),
        _tiny("tiny_exact_conic", LOOSE),
        Spec("render", CASE, "render", TITLE, (), lens_settings(RASTER, degree=2), scene, without=("visible",)),
        Spec("render", "some_deviations", "render", "Preset legacy with two of its four deviations", (),
             lens_settings(LOOSE, degree=1), other, without=("visible",)),
    ]  # fmt: skip


def _initialisation() -> Spec:
    model = written_section(ModelConfig(bases=2, harmonics_degree=0, initial_width=0.0625))
    drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=3.0)
    settings = {"camera": SMALL_LENS, "initialisation": written_section(drawn, OF_THE_INITIALISATION), "model": model}
    inputs = frames(Seeds("initialisation", CASE), 3, [0, 2])
    return Spec("initialisation", CASE, "initialisation", TITLE, (), settings, inputs)


def _moving(family: str, case: str, title: str, loss: dict[str, Any], without: tuple[str, ...], **model: Any) -> Spec:
    """The moving scene of `scene` or `objective`, without the arrays of disabled components."""
    seeds = Seeds(family, case)
    settings = written_section(msgspec.structs.replace(ModelConfig(), **(MODEL | model)))
    inputs = moving_inputs(seeds, 1, True, frequencies=MODEL["frequencies"])
    inputs = {name: made for name, made in inputs.items() if name not in without}
    if family == "scene":
        inputs = {name: made for name, made in inputs.items() if name not in ("rotation_matrix", "translation")}
        return Spec(family, case, family, title, (), {"t": 0.3984375, "model": settings}, inputs)
    inputs |= image_inputs(seeds)
    whole = {"t": 0.3984375, "degree": 1, "camera": LENS, "preset": "paper", "raster": raster_dict(RASTER)}
    return Spec(family, case, family, title, (), whole | {"model": settings, "loss": loss}, inputs)


def _moving_scenes() -> list[Spec]:
    weights = {"ssim_weight": 0.5, "depth_weight": 0.375, "smoothness_weight": 0.25, "total_variation_factor": 5.0,
               "lambda_msp": 3.0, "lambda_lap": 0.3125, "upsampling": "half_pixel"}  # fmt: skip
    none = weights | {"ssim_weight": 0.0, "depth_weight": 0.0, "smoothness_weight": 0.0}
    residuals = ("appearance_coefficients", "motion_coefficients")
    off = {"appearance": False, "spectral_motion": False, "laplacian": False}
    return [
        _moving("scene", CASE, TITLE, {}, ()),
        _moving("objective", CASE, TITLE, weights, ()),
        _moving("objective", "components_off", "A, S and L off, and no term but L1", none, residuals, **off),
    ]


def _schedule() -> list[Spec]:
    config = Config(
        model=ModelConfig(harmonics_degree=1),
        loss=LossConfig(lambda_lap=1.25, laplacian_from=2, laplacian_full=5, smoothness_from=7,
                        smoothness_weight=0.5),
        optimiser=OptimiserConfig(
            position=0.01, deformation=0.02, deformation_position_factor=3.0, harmonics_base=0.03,
            harmonics_rest=0.04, opacity=0.06, scale=0.07, rotation=0.08, spectral_motion_factor=0.3,
            appearance_factor=0.7, final_factor=0.2, annealed_factor=0.125, annealing_from=10,
        ),
        density=DensityConfig(start=2, interval=4, until=9),
        training=TrainingConfig(iterations=16, residual_activation=3, harmonics_interval=5),
    )  # fmt: skip
    off = msgspec.structs.replace(
        config,
        model=ModelConfig(appearance=False, spectral_motion=False, laplacian=False),
        optimiser=msgspec.structs.replace(config.optimiser, annealing_from=16),
        loss=msgspec.structs.replace(config.loss, smoothness_weight=0.0),
    )
    still = msgspec.structs.replace(config, optimiser=msgspec.structs.replace(config.optimiser, annealing_from=18))
    made = given(np.arange(1, 17), ", ".join(map(str, range(1, 17))), "iteration")

    def spec(case: str, title: str, one: Config) -> Spec:
        return Spec("schedule", case, "schedule", title, (), {"config": written(one)}, {"iteration": made})

    return [
        spec(CASE, f"{TITLE}: every rate and milestone; constant rates annealed from 10 on", config),
        spec("components_off", "A, S and L off; annealing from the last iteration on", off),
        spec("annealing_after_the_end", "Annealing that begins after the last iteration", still),
    ]


def _config() -> Config:
    """A trajectory in which every setting differs from the published one."""
    return Config(
        model=ModelConfig(**{**MODEL, "harmonics_degree": 1}),
        raster=RasterConfig(near=0.5, alpha_cutoff=0.02, transmittance_stop=0.01, alpha_max=0.9),
        loss=LossConfig(ssim_weight=0.5, depth_weight=0.375, smoothness_weight=0.0625, total_variation_factor=5.0,
                        smoothness_from=4, lambda_msp=3.0, lambda_lap=0.625, laplacian_from=1, laplacian_full=4,
                        upsampling="half_pixel"),
        optimiser=OptimiserConfig(
            position=0.004, deformation=0.002, deformation_position_factor=2.0, harmonics_base=0.005,
            harmonics_rest=0.003, opacity=0.03, scale=0.01, rotation=0.002, spectral_motion_factor=0.3,
            appearance_factor=4.0, final_factor=0.25, annealed_factor=0.5, annealing_from=5,
            restart_residual_schedule=False, beta1=0.75, beta2=0.984375, epsilon=1e-4, legacy_skip=True,
        ),
        density=DensityConfig(start=1, interval=3, until=8, gradient_threshold=0.015, extent="cameras",
                              dense_fraction=0.75, prune_opacity=0.03, maximum=20),
        training=TrainingConfig(iterations=10, residual_activation=4, harmonics_interval=3),
    )  # fmt: skip


def _trajectory(case: str, title: str, config: Config, degree: int, change=None, flags=()) -> Spec:
    seeds = Seeds("training", case)
    inputs = trajectory_inputs(seeds, config.training.iterations, degree)
    if change:
        change(inputs)
    return Spec("training", case, "training", title, flags, {"camera": LENS, "config": written(config)}, inputs)


def _moving_camera(inputs: dict[str, Made]) -> None:
    k = np.arange(FRAMES)
    moved = np.stack([0.25 * (k % 3), -0.125 * (k % 2), 0.015625 * k], axis=1)
    inputs["translations"] = given(moved, "(k % 3 / 4, -(k % 2) / 8, k / 64)", "scene unit")


def _trajectories() -> list[Spec]:
    config = _config()
    off = Config(
        model=ModelConfig(bases=BASES, harmonics_degree=1, appearance=False, spectral_motion=False, laplacian=False),
        loss=LossConfig(depth_weight=0.0, smoothness_weight=0.0, lambda_lap=0.5, laplacian_from=0, laplacian_full=1),
        optimiser=OptimiserConfig(epsilon=1e-4),
        training=TrainingConfig(iterations=6, residual_activation=3, harmonics_interval=2),
    )
    five = Config(
        model=ModelConfig(bases=BASES, harmonics_degree=1, laplacian=True, appearance=False),
        raster=RasterConfig(preset="legacy"),
        loss=LossConfig(lambda_lap="auto", laplacian_from=0, laplacian_full=2, smoothness_weight=0.0,
                        calibration_views=5, gradient_ratio=0.5),
        optimiser=OptimiserConfig(epsilon=1e-4),
        training=TrainingConfig(iterations=4, residual_activation=2, harmonics_interval=2),
    )  # fmt: skip
    return [
        _trajectory(CASE, "No setting is the published one; the Laplacian weight is a number", config, 1,
                    _moving_camera),
        _trajectory("components_off", "A, S and L off, no depth term", off, 1),
        _trajectory("five_views", "Preset legacy, S without A, calibration on five views of ten", five, 1,
                    flags=("calibration_views_down", "calibration_views_up")),
    ]  # fmt: skip


def cases() -> list[Spec]:
    """Operations, the splatting, the first Gaussians, schedules, whole scenes and trajectories."""
    return [*_operations(), *_splatting(), *_schedule(), _initialisation(), *_moving_scenes(), *_trajectories()]
