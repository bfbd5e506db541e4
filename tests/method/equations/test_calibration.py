"""Equation (7): the calibrated detail weight, hard cases K1 to K3."""

import numpy as np
import pytest

from endotsr.definition import calibration as definition
from endotsr.definition.masked_ssim import ssim_target
from endotsr.definition.objective import Targets, photometric_loss
from endotsr.errors import CalibrationError
from endotsr.method.equations.calibration import calibrate, calibration_views, rms
from endotsr.method.equations.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks


def views(pairs):
    return [(f"frame-{i:03d}", rgb, lap) for i, (rgb, lap) in enumerate(pairs)]


@pytest.mark.parametrize("count", [1, 2, 5, 16])
def test_equals_its_definition(count):
    pairs = np.random.default_rng(count).uniform(0.1, 2.0, (count, 2)).tolist()
    found = calibrate(views(pairs), 0.25)
    assert found.lambda_lap == pytest.approx(definition.calibrate(views(pairs), 0.25).lambda_lap, rel=1e-15)
    assert found.ratios.shape == (count,)
    assert all(f"frame-{i:03d}" in found.table for i in range(count))


def test_hard_K1_invalid_views_are_dropped_and_listed():
    good = [(1.0, 0.2), (1.0, 0.4), (1.0, 0.3)]
    bad = [(0.0, 0.0), (0.0, 1.0), (np.nan, 1.0), (1.0, np.inf), (-1.0, 1.0), (1.0, -0.1), (5e-324, 1e10)]
    found = calibrate(views(good + bad), 0.3)
    assert found.lambda_lap == pytest.approx(1.0, rel=1e-15)
    assert found.ratios.tolist() == [0.2, 0.4, 0.3]
    assert found.table.count("\n") == 10
    assert "not finite" in found.table and "no photometric gradient" in found.table


@pytest.mark.parametrize(
    "pairs",
    [
        [], [(0.0, 0.0)], [(np.nan, np.nan), (0.0, 1.0)], [(1.0, 0.0)], [(1.0, 0.0), (1.0, 0.0), (1.0, 3.0)],
        [(1.0, 1e-310)],
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # of the definition, which divides before it refuses
def test_hard_K1_no_answer_is_an_error_with_a_table(pairs):
    with pytest.raises(CalibrationError) as caught:
        calibrate(views(pairs), 0.25)
    assert "g_rgb" in str(caught.value)
    with pytest.raises(ValueError, match="no view has a ratio"), np.errstate(invalid="ignore", divide="ignore"):
        definition.calibrate(views(pairs), 0.25)
    assert all(f"frame-{i:03d}" in str(caught.value) for i in range(len(pairs)))


def test_hard_K2_linear_in_the_ratio_and_even_counts_average():
    pairs = [(1.0, 0.1), (1.0, 0.2), (1.0, 0.4), (1.0, 5.0)]
    assert calibrate(views(pairs), 0.3).lambda_lap == pytest.approx(1.0, rel=1e-15)
    assert calibrate(views(pairs), 0.5).lambda_lap == 2 * calibrate(views(pairs), 0.25).lambda_lap


def test_hard_K2_masked_pixels_do_not_change_the_weight():
    rng = np.random.default_rng(0)
    rgb, lap = rng.normal(size=(3, 8, 8)), rng.normal(size=(3, 8, 8))
    padded = [np.pad(g, ((0, 0), (0, 5), (0, 3))) for g in (rgb, lap)]
    a = calibrate([("a", rms(rgb), rms(lap))], 0.25).lambda_lap
    b = calibrate([("a", rms(padded[0]), rms(padded[1]))], 0.25).lambda_lap
    assert a == pytest.approx(b, rel=1e-15)


def test_hard_K3_rms_ignores_the_size_of_the_residuals():
    rng = np.random.default_rng(1)
    observed, error = rng.random((3, 20, 20)), rng.normal(size=(3, 20, 20))
    masks = support_masks(np.ones((20, 20)))
    sizes = []
    for scale in (0.25, 0.5):  # powers of two scale every band without rounding
        _, saved = laplacian_loss_forward(scale * error, 0.0 * observed, masks)
        sizes.append(rms(laplacian_loss_reverse(1.0, saved)))
    assert sizes[0] == sizes[1]


def test_rms():
    assert rms(np.array([[3.0, -4.0], [0.0, 0.0]])) == 2.5
    assert rms(np.zeros((0, 2))) == 0.0
    assert rms(np.full(10, 1e-30, np.float32)) == pytest.approx(1e-30, rel=1e-6)
    assert np.isnan(rms(np.array([1.0, np.nan])))


def test_calibration_views():
    assert calibration_views(55, 16).tolist() == np.round(np.linspace(0, 54, 16)).astype(int).tolist()
    assert calibration_views(5, 16).tolist() == [0, 1, 2, 3, 4]
    assert calibration_views(1, 16).tolist() == [0]
    assert calibration_views(10, 1).tolist() == [0]
    assert calibration_views(0, 16).size == 0


def test_refused_ratio():
    for ratio in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="ratio"):
            calibrate(views([(1.0, 1.0)]), ratio)


def ratio(mask, right, below):
    """RMS of the Laplacian gradient over that of the photometric one, with excluded pixels appended to the images."""
    rng = np.random.default_rng(4)
    observed = rng.random((3, *mask.shape))
    rendered = observed + 0.1 * rng.normal(size=observed.shape)
    pad = ((0, below), (0, right))
    mask, (rendered, observed) = np.pad(mask, pad), (np.pad(a, ((0, 0), *pad)) for a in (rendered, observed))
    _, saved = laplacian_loss_forward(rendered, observed, support_masks(mask))
    target = ssim_target(observed, mask)
    _, _, photometric = photometric_loss(rendered, Targets(target.image, mask, target, None, None), 0.1)
    return rms(laplacian_loss_reverse(1.0, saved)) / rms(photometric)


@pytest.mark.parametrize("size", [(48, 52), (47, 51)])
def test_hard_K2_pixels_appended_to_excluded_ones_do_not_change_the_weight(size):
    """At a border of tissue they do: the pyramid reflects there, and beside excluded pixels it has no valid values."""
    mask = np.ones(size, bool)
    assert abs(ratio(mask, 9, 7) / ratio(mask, 0, 0) - 1) > 0.01
    mask[-1], mask[:, -1] = False, False
    assert ratio(mask, 9, 7) == pytest.approx(ratio(mask, 0, 0), rel=1e-12)
