"""Edges of the definition that the compiled method has too: long axes, a threshold of 0, excluded NaN, views."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from endotsr.config import PAPER
from endotsr.definition import calibration as definition_of_calibration
from endotsr.definition import density_control as definition_of_density
from endotsr.definition.registration import registration_forward
from endotsr.definition.scene import Gaussians as PlainGaussians
from endotsr.definition.settings import PAPER_CONFIG
from endotsr.definition.smoothness import smoothness_forward as plain_smoothness
from endotsr.definition.smoothness import smoothness_reverse as plain_reverse
from endotsr.method.equations import calibration
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.training.scene import density_control
from endotsr.training.scene.gaussians import Gaussians


def scenes(count, log_scale):
    """The same Gaussians for both."""
    values = {
        "position": np.zeros((3, count)),
        "quaternion": np.tile(np.eye(4)[:, :1], count),
        "log_scale": np.full((3, count), log_scale),
        "opacity_logit": np.zeros(count),
        "harmonics": np.zeros((1, 3, count)),
    }
    return PlainGaussians(**values), Gaussians(**values)


def densified(count, log_scale, visited, **changed):
    """By the definition and by the method; every Gaussian has this gradient and these visits."""
    plain, compiled = scenes(count, log_scale)
    sums = np.full(count, float(visited)), np.full(count, visited)
    found = []
    for room, gaussians, config in (
        (definition_of_density, plain, PAPER_CONFIG.density._replace(**changed)),
        (density_control, compiled, method_config(**changed)),
    ):
        statistics = room.DensityStatistics(*sums)
        found.append(room.densify(gaussians, statistics, config, np.random.default_rng(0), 10.0))
    return found


def method_config(**changed):
    """As the settings of `paper`, without their validation: a threshold of 0 is refused there."""
    return SimpleNamespace(**msgspec.structs.asdict(PAPER.density) | changed)


@pytest.mark.parametrize("log_scale", [3.0, 45.0])
def test_children_of_a_long_axis_are_where_the_method_puts_them(log_scale):
    one, other = densified(1, log_scale, 1)
    np.testing.assert_allclose(one.gaussians.position, other.gaussians.position, rtol=1e-12)
    assert np.ptp(one.gaussians.position) > 0


def test_a_threshold_of_0_selects_gaussians_without_a_gradient_and_a_budget_does_not():
    for growth, grown in (("threshold", 4), ("budget", 2)):
        counts = [
            found.gaussians.opacity_logit.size
            for found in densified(2, -20.0, 0, gradient_threshold=0.0, growth=growth)
        ]
        assert counts == [grown, grown]


def test_without_total_variation_no_excluded_pixel_reaches_the_smoothness():
    mask = np.ones((6, 7), bool)
    mask[0] = False
    depth = np.where(mask, np.random.default_rng(0).random((6, 7)), np.nan)
    image = np.tile(depth, (3, 1, 1))
    for forward, reverse in (
        (plain_smoothness, plain_reverse),
        (smoothness_forward, smoothness_reverse),
    ):
        loss, saved = forward(depth, image, mask, np.zeros_like(mask), 0.0)
        grads = reverse(1.0, saved)
        assert np.isfinite(loss) and grads.d_rendered_depth[mask].any()
        assert not np.any(grads.d_rendered) and not np.any(grads.d_rendered_depth[0])


def test_a_point_out_of_view_has_no_slope_even_if_it_is_no_number():
    camera = Camera(np.eye(3), np.zeros(3), 8.0, 8.0, 4.0, 4.0, 8, 8)
    points = np.array([[0.0, np.nan], [0.0, 0.0], [2.0, 2.0]])
    residual, saved = registration_forward(
        np.eye(3), np.zeros(3), points, np.zeros(2), np.random.default_rng(1).random((8, 8)), camera
    )
    assert residual[1] == 0 and saved.slope[:, 0].any() and not saved.slope[:, 1].any()


def test_a_view_with_a_negative_gradient_is_dropped_and_no_frame_is_no_view():
    views = [("a", 1.0, -3.0), ("b", 2.0, 1.0)]
    for room in (definition_of_calibration, calibration):
        assert room.calibrate(views, 0.25).lambda_lap == 0.5
        assert room.calibration_views(0, 4).size == 0 and room.calibration_views(9, 3).tolist() == [0, 4, 8]
