"""Trained real scenes, needles of anisotropy in the thousands: no NaN and no infinity out, every gradient finite."""

import numpy as np
import pytest
from made_up_scenes import Y00, as_dtype, assert_finite, run

from data_folder import data_folder
from endotsr.method.equations.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.method.losses.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import PRESETS

WIDTH, HEIGHT = 80, 60


def trained_scene(name: str, every: int, dtype) -> tuple[Scene, Camera]:
    """Every `every`-th Gaussian, enlarged to fill the gaps, seen from within by a camera turned at random."""
    with np.load(data_folder("trained_splats") / f"{name}.npz") as file:
        data = {key: file[key][::every].astype(np.float64) for key in file.files}
    opacity = np.clip(data["opacity"], 1e-6, 1 - 1e-6)
    scene = Scene(
        data["xyz"].T, data["quat_wxyz"].T, data["log_scale"].T + np.log(every) / 3,
        np.log(opacity / (1 - opacity)), ((data["rgb"].T - 0.5) / Y00)[None],
    )  # fmt: skip
    low, high = np.percentile(data["xyz"], [5, 95], axis=0)
    middle = (low + high) / 2 - np.array([0, 0, 0.2 * np.max(high - low)])
    return as_dtype(scene, dtype), Camera(np.eye(3), -middle, 65.0, 65.0, 40.0, 30.0, WIDTH, HEIGHT)


def gradients_of_the_losses(images, dtype):
    """By colour and depth of L1, SSIM, detail and depth loss, with a hole in the mask."""
    rng = np.random.default_rng(0)
    observed = rng.uniform(0, 1, (3, HEIGHT, WIDTH)).astype(dtype)
    prior = rng.uniform(40, 60, (HEIGHT, WIDTH)).astype(dtype)
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[30:, 50:60] = False
    colour, depth = np.ascontiguousarray(images["colour"]), np.ascontiguousarray(images["depth"])
    l1, l1_saved = masked_l1_forward(colour, observed, mask)
    ssim, ssim_saved = masked_ssim_forward(colour, ssim_target(observed, mask))
    detail, detail_saved = laplacian_loss_forward(colour, observed, support_masks(mask))
    z, z_saved = normalised_depth_forward(depth, depth_target(prior, mask))
    assert np.isfinite([l1, ssim, detail, z]).all() and min(l1, detail, z) > 0
    d_colour = (
        masked_l1_reverse(1.0, l1_saved)
        + masked_ssim_reverse(-0.1, ssim_saved)
        + laplacian_loss_reverse(0.83, detail_saved)
    )
    return d_colour, normalised_depth_reverse(1.0, z_saved), np.zeros_like(depth)


@pytest.mark.data
@pytest.mark.parametrize("name", ["biker_splats", "guitar_splats"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("preset", list(PRESETS))
def test_trained_scene_is_finite_from_losses_to_parameters(preset, dtype, name):
    scene, camera = trained_scene(name, 64 if preset == "exact" else 16, dtype)
    assert np.exp(np.ptp(scene.log_scale.astype(np.float64), axis=0)).max() > 1000
    for path in ("definition", "blocks") if preset == "paper" else ("definition",):
        images, _ = run(scene, camera, PRESETS[preset], path)
        assert (images["opacity"] > 0.5).mean() > 0.02
        given = gradients_of_the_losses(images, dtype)
        _, gradients = run(scene, camera, PRESETS[preset], path, given=given)
        assert_finite(images, gradients)
        for block in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics"):
            assert gradients[block].dtype == dtype and gradients[block].any(), block
