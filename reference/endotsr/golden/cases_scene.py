"""Golden cases of the whole method: moving scene, objective, training trajectory, determinism."""

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
from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.cases_equations import stamps, tissue, train_index
from endotsr.golden.cases_splatting import PRESETS, pose, scene_inputs
from endotsr.golden.generator import Made, changed, given
from endotsr.golden.operation import written
from endotsr.golden.operations_splatting import raster_dict

COUNT, BASES, FREQUENCIES, FRAMES = 12, 3, 2, 12
LENS = {"fx": 24.0, "fy": 24.0, "cx": 12.0, "cy": 10.0, "width": 25, "height": 21}
WEIGHTS = {
    "ssim_weight": 0.25, "depth_weight": 1.0, "smoothness_weight": 0.05, "total_variation_factor": 2.0,
    "lambda_msp": 1.0, "lambda_lap": 0.75, "upsampling": "co_sited",
}  # fmt: skip


def _model(**changes: Any) -> dict[str, Any]:
    model = ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.25)
    return written(msgspec.structs.replace(model, **changes))


def moving_inputs(seeds: Seeds, degree: int, static: bool, count: int = COUNT) -> dict[str, Made]:
    """Raw parameters of every component, off zero."""
    shape, atoms = (10, BASES, count), 2 * FREQUENCIES
    centre = seeds.uniform("fdm_centre", 0.1, 0.7, *shape)
    return scene_inputs(seeds, count, degree, pose(static)) | {
        "fdm_weight": seeds.uniform("fdm_weight", -0.08, 0.08, *shape, unit="raw parameter"),
        "fdm_centre": centre,
        "fdm_width": seeds.uniform("fdm_width", 0.25, 0.5, *shape),
        "appearance_coefficients": seeds.uniform("colour_coefficients", -0.5, 0.5, 3, atoms, count),
        "motion_coefficients": seeds.uniform("motion_coefficients", -0.05, 0.05, 3, atoms, count, unit="scene unit"),
        "times": stamps(FRAMES),
        "train_index": train_index(FRAMES),
    }


def _scenes() -> list[Spec]:
    out = []
    for basis in ("quartic", "gaussian"):
        seeds = Seeds("scene", basis)
        flags = ("motion_of_normalised_atoms", "statistics_over_all_frames", "missing_y00", "basis_swapped",
                 "deformation_channels_shifted", "scale_offset_after_activation")  # fmt: skip
        inputs = moving_inputs(seeds, 0, True)
        for name in ("rotation_matrix", "translation", "harmonics", "opacity_logit"):
            kept = inputs.pop(name)
            if name in ("harmonics", "opacity_logit"):
                inputs[name] = kept
        settings = {"t": 0.3984375, "model": _model(basis=basis)}
        title = f"Every component at one time: offsets before activation, raw and normalised atoms ({basis})"
        out.append(Spec("scene", basis, "scene", title, flags, settings, inputs))
    return out


def _image_inputs(seeds: Seeds, height: int, width: int) -> dict[str, Made]:
    edges = np.zeros((height, width), bool)
    edges[2 : height - 2, 9] = True
    prior = seeds.uniform("prior_depth", 2.0, 7.0, height, width, unit="scene unit")
    return {
        "observed": seeds.uniform("observed", 0.0, 1.0, 3, height, width, unit="display"),
        "mask": tissue(height, width, 4, 5),
        "prior_depth": changed(prior, ([8, 9], [8, 3]), 0.0, "(8, 8) and (9, 3) are 0: no depth"),
        "edges": given(edges, f"True in column 9, rows 2..{height - 3}"),
    }


def _objective_case(case: str, preset: str, title: str, flags: tuple[str, ...], degree: int = 3, static: bool = False,
                    basis: str = "quartic", upsampling: str = "co_sited", change=None, operation="objective",
                    draw: int = 0) -> Spec:  # fmt: skip
    seeds = Seeds(operation, case, draw)
    inputs = moving_inputs(seeds, degree, static) | _image_inputs(seeds, int(LENS["height"]), int(LENS["width"]))
    if change:
        change(inputs)
    settings = {
        "t": 0.3984375,
        "degree": degree,
        "camera": LENS,
        "raster": raster_dict(PRESETS[preset]),
        "model": _model(basis=basis),
        "loss": WEIGHTS | {"upsampling": upsampling},
    }
    return Spec(operation, case, operation, title, flags, settings, inputs)


def _objectives() -> list[Spec]:
    terms = ("depth_term_dropped", "laplacian_term_dropped", "penalty_dropped", "ssim_term_dropped",
             "ssim_sign", "smoothness_dropped", "upsampling_swapped", "photometric_of_clamped_render",
             "laplacian_gradient_dropped", "depth_loss_gradient_dropped", "penalty_gradient_dropped",
             "deformation_of_position_only", "residual_gradient_unscaled", "statistics_over_test_frames_in_training",
             "pixel_corner_camera")  # fmt: skip

    def empty_level(inputs: dict[str, Made]) -> None:
        height, width = int(LENS["height"]), int(LENS["width"])
        inputs["mask"] = tissue(height, width, 11, 13)

    def bare(inputs: dict[str, Made]) -> None:
        for name in ("fdm_weight", "fdm_centre", "fdm_width", "appearance_coefficients", "motion_coefficients"):
            del inputs[name]

    dim = tuple(term for term in terms if term != "photometric_of_clamped_render")

    def bright(inputs: dict[str, Made]) -> None:
        h = inputs["harmonics"]
        inputs["harmonics"] = changed(h, (0, 0), h.array[0, 0] + 3.0, "[0, 0] plus 3: red above 1")

    return [
        _objective_case("paper", "paper", "Preset paper, every component, moving camera", terms, change=bright),
        _objective_case("exact", "exact", "Preset exact, every component", dim, basis="gaussian"),
        _objective_case("legacy", "legacy", "Preset legacy: the released code's gradients", ("deviations_off",)),
        _objective_case("half_pixel", "paper", "The other up-sampling, degree 1, static camera",
                        ("upsampling_swapped",), 1, True, upsampling="half_pixel"),
        _objective_case("empty_level", "paper", "The mask leaves no valid pixel at level 3", ("empty_level_rescaled",),
                        1, True, change=empty_level),
        _objective_case("base_model", "paper", "No component A, S, no deformation: a rigid scene", (), 2, True,
                        change=bare),
    ]  # fmt: skip


def training_config(**training: Any) -> Config:
    """Twenty iterations with everything inside: both residuals born, detail ramp, degree raise, densification."""
    return Config(
        model=ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.25, harmonics_degree=2),
        raster=RasterConfig(near=0.2),
        loss=LossConfig(
            ssim_weight=0.25, smoothness_weight=0.0, smoothness_from=1000, lambda_lap="auto", laplacian_from=4,
            laplacian_full=12, calibration_views=4,
        ),
        optimiser=OptimiserConfig(position=0.004, deformation=0.002),
        density=DensityConfig(start=5, interval=6, until=14, gradient_threshold=0.02, extent=30.0, prune_opacity=0.02),
        initialisation=InitialisationConfig(first_frame_points=100, other_frame_points=0, motion_threshold=1.0),
        training=TrainingConfig(iterations=20, residual_activation=8, harmonics_interval=7, **training),
    )  # fmt: skip


def _training() -> list[Spec]:
    seeds = Seeds("training", "twenty_iterations")
    height, width = int(LENS["height"]), int(LENS["width"])
    inputs = scene_inputs(seeds, 16, 2, pose(static=True))
    for name in ("rotation_matrix", "translation"):
        del inputs[name]
    inputs["opacity_logit"] = changed(inputs["opacity_logit"], 3, -5.0, "[3] is -5: pruned")
    small = inputs["log_scale"].array[:, 5:10] - 1.75
    inputs["log_scale"] = changed(
        inputs["log_scale"], (slice(None), slice(5, 10)), small, "[:, 5:10] minus 1.75: cloned"
    )
    shape = (10, BASES, 16)
    inputs["fdm_weight"] = seeds.uniform("fdm_weight", -0.03, 0.03, *shape)
    inputs["fdm_centre"] = seeds.uniform("fdm_centre", 0.1, 0.8, *shape)
    inputs["fdm_width"] = seeds.uniform("fdm_width", 0.25, 0.5, *shape)
    index = np.arange(FRAMES)
    grey = seeds.uniform("images", 0.0, 256.0, FRAMES, 3, height, width).array
    moved = np.stack([np.array([0.02 * k, -0.01 * k, 0.015625 * k]) for k in index])
    mask = np.broadcast_to(tissue(height, width, 4, 5).array, (FRAMES, height, width)).copy()
    mask[::2, 0, :] = False
    order = seeds.uniform("frame_order", 0.0, 10.0, 20).array
    inputs |= {
        "images": given(np.floor(grey).astype(np.int64), f"floor of uniform(0.0, 256.0) seed {seeds.seed('images')}",
                        "display / 255"),
        "masks": given(mask, "False in the last 4 rows of the last 5 columns, and in row 0 of even frames"),
        "prior_depths": seeds.uniform("prior_depths", 2.0, 7.0, FRAMES, height, width, unit="scene unit"),
        "times": stamps(FRAMES),
        "train_index": train_index(FRAMES),
        "rotation_matrices": given(np.stack([np.eye(3)] * FRAMES), "identity"),
        "translations": given(moved, "(0.02, -0.01, 1/64) k", "scene unit"),
        "frame_order": given(np.floor(order).astype(np.int64), f"floor of uniform(0.0, 10.0) seed "
                             f"{seeds.seed('frame_order')}; positions within train_index", "frame"),
        "split_noise": seeds.uniform("split_noise", -1.5, 1.5, 2, 3, 32),
    }  # fmt: skip
    settings = {"camera": LENS, "config": written(training_config())}
    flags = ("skipped_step_when_densifying", "residuals_activated_late", "rates_not_decaying", "laplacian_weight_not_ramped",
             "penalty_dropped_in_training", "calibration_of_half_ratio", "densify_threshold_in_pixels")  # fmt: skip
    title = "Calibration, then twenty iterations: densification at 6 and 12, residuals from 9 on, detail ramp, degree 2"
    return [Spec("training", "twenty_iterations", "training", title, flags, settings, inputs)]


def cases() -> list[Spec]:
    """All of them."""
    twice = _objective_case("twice", "paper", "The same request twice gives the same bits", ("sums_in_any_order",),
                            operation="determinism")  # fmt: skip
    return [*_scenes(), *_objectives(), *_training(), twice]
