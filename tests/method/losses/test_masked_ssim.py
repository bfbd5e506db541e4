"""Masked SSIM (B7)."""

import numpy as np
import pytest
from scipy import ndimage

from endotsr.definition import masked_ssim as definition
from endotsr.method.losses.masked_ssim import (
    C1,
    C2,
    TAPS,
    _column_moments,
    _row_moments,
    masked_ssim_forward,
    masked_ssim_reverse,
    ssim_target,
    window,
)
from method.losses.made_up_images import images, tool_mask
from oracle.complex_step import derivative

U32, U64 = 2.0**-24, 2.0**-53


def ssim(rendered, observed, mask=None):
    mask = np.ones(rendered.shape[1:], bool) if mask is None else mask
    value, saved = masked_ssim_forward(rendered, ssim_target(observed, mask))
    return value, masked_ssim_reverse(1.0, saved)


def by_definition(rendered, observed, mask):
    """(B7) in long doubles: E[x^2] - E[x]^2 loses digits."""
    wide = (image.astype(np.longdouble) for image in (rendered, observed))
    return float(definition.masked_ssim_forward(next(wide), definition.ssim_target(next(wide), mask))[0])


def definition_over(rendered, observed, pixels):
    """Mean over some pixels of the map of the whole images."""
    target = definition.ssim_target(observed, np.ones(pixels.shape, bool))
    return definition.masked_ssim_forward(rendered, target)[1].map[:, pixels].mean()


def complex_steps(rendered, observed, mask):
    target = definition.ssim_target(observed, mask)
    return derivative(lambda moved: definition.masked_ssim_forward(moved, target)[0], rendered)


def scipy_ssim(x, y, mask):
    """The usual E[x^2] - E[x]^2 form through scipy's filter with zero padding."""
    x, y = np.where(mask, x, 0), np.where(mask, y, 0)
    mean = lambda image: ndimage.gaussian_filter(image, (0, 1.5, 1.5), mode="constant", radius=(0, 5, 5))
    mx, my = mean(x), mean(y)
    above = (2 * mx * my + C1) * (2 * (mean(x * y) - mx * my) + C2)
    below = (mx**2 + my**2 + C1) * (mean(x * x) - mx**2 + mean(y * y) - my**2 + C2)
    return (above / below)[:, mask].mean()


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.5])
def test_equals_the_definition_and_scipy(noise):
    rendered, observed = images(noise=noise)
    mask = tool_mask()
    value, _ = ssim(rendered, observed, mask)
    assert value == pytest.approx(by_definition(rendered, observed, mask), abs=1e-14)
    assert value == pytest.approx(scipy_ssim(rendered, observed, mask), abs=1e-11)


def test_large_image_equals_skimage_inside():
    """Away from the border skimage's Gaussian SSIM is the same map (its window reaches 5 pixels as well)."""
    from skimage.metrics import structural_similarity

    rendered, observed = images((1, 40, 40))
    _, full = structural_similarity(
        rendered[0], observed[0], data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    inside = np.zeros((40, 40), bool)
    inside[5:-5, 5:-5] = True
    value = definition_over(rendered, observed, inside)
    assert value == pytest.approx(full[inside].mean(), abs=1e-12)


def test_a_mask_of_one_pixel_in_one_channel_has_a_gradient():
    rendered, observed = images((1, 8, 9))
    mask = np.zeros((8, 9), bool)
    mask[3, 4] = True
    expected = complex_steps(rendered, observed, mask)
    assert abs(expected[0, 3, 4]) > 1e-6
    np.testing.assert_allclose(ssim(rendered, observed, mask)[1], expected, rtol=1e-9, atol=1e-15)


def test_hard_X1_float32_keeps_the_variance_of_bright_even_regions():
    """E[x^2] - E[x]^2 in float32 is off by 1e-6 where the variance is 1e-6; here 1 - SSIM keeps its digits."""
    rng = np.random.default_rng(3)
    observed = (0.95 + 1e-3 * rng.standard_normal((1, 24, 24))).astype(np.float32)
    rendered = (observed + 1e-3 * rng.standard_normal(observed.shape)).astype(np.float32)
    mask = np.zeros((24, 24), bool)
    mask[8:16, 8:16] = True  # windows inside the image
    everywhere = np.ones((24, 24), bool)
    exact = definition_over(rendered.astype(float), observed.astype(float), mask)
    found = _mean_inside(rendered, observed, mask, everywhere)
    assert abs((1 - found) - (1 - exact)) <= 40 * U32 * (1 - exact)


def _mean_inside(rendered, observed, inside, everywhere):
    """Mean of the map over `inside` when the images are not masked: read off the slopes of the mean by linearity."""
    from endotsr.method.losses import masked_ssim as similarity

    target = similarity.ssim_target(observed, everywhere)
    shape = (1, 34, 34)
    difference, total = np.zeros(shape, observed.dtype), np.zeros(shape, observed.dtype)
    similarity._difference_and_sum_kernel(0, 24, rendered, target.image, everywhere, difference, total)
    totals = np.empty(24)
    slopes = np.empty((3, *shape), observed.dtype)
    weights = similarity.window(observed.dtype)
    similarity._similarity_kernel(0, 24, difference, total, inside, weights, slopes, totals)
    return 1 - totals.sum() / inside.sum()


def test_hard_X1_constant_images():
    bright, dark = np.full((1, 30, 30), 0.9, np.float32), np.full((1, 30, 30), 0.7, np.float32)
    wide = ssim(bright.astype(float), dark.astype(float))[0]
    assert abs(ssim(bright, dark)[0] - wide) <= 8 * U32


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (3, 5), (10, 4), (11, 11)])
def test_hard_X2_smaller_than_the_window(shape):
    rendered, observed = images((3, *shape))
    mask = np.ones(shape, bool)
    value, gradient = ssim(rendered, observed, mask)
    assert value == pytest.approx(by_definition(rendered, observed, mask), abs=1e-14)
    expected = complex_steps(rendered, observed, mask)
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_hard_X3_no_tissue_is_one_without_gradient():
    rendered, observed = images()
    value, gradient = ssim(rendered, observed, np.zeros(rendered.shape[1:], bool))
    assert value == 1.0
    assert not gradient.any()


def test_float32_gradient_against_float64():
    rendered, observed = (a.astype(np.float32) for a in images((3, 40, 50), noise=0.03))
    mask = tool_mask((40, 50))
    value, gradient = ssim(rendered, observed, mask)
    wide, wide_gradient = ssim(rendered.astype(float), observed.astype(float), mask)
    assert gradient.dtype == np.float32
    assert abs(value - wide) <= 20 * U32 * (1 - wide)
    assert np.linalg.norm(gradient - wide_gradient) <= 1e-5 * np.linalg.norm(wide_gradient)


def test_target_is_zero_under_the_mask():
    _, observed = images()
    target = ssim_target(observed, tool_mask())
    assert not target.image[:, ~tool_mask()].any()
    assert target.count == 3 * tool_mask().sum()


def test_variances_keep_their_digits_beside_far_away_values():
    """Each window is centred on a value of its own: in float32 a centre 1000 away would leave no digit of 1e-4."""
    rng = np.random.default_rng(3)
    far = np.where(np.arange(8) % 2, 1000.0, 0.0)
    rows = (far + rng.normal(0, 0.01, (TAPS, 8))).astype(np.float32)
    weights, exact = window(np.dtype(np.float32)), rows.astype(np.float64)
    mean, variance = np.empty(8, np.float32), np.empty(8, np.float32)
    _column_moments(rows, weights, mean, variance)
    share = weights.astype(np.float64)
    wanted = share @ (exact - share @ exact / share.sum()) ** 2
    np.testing.assert_allclose(variance, wanted, rtol=1e-2)
    np.testing.assert_allclose(mean, share @ exact / share.sum(), rtol=1e-6, atol=1e-6)


def test_a_row_of_windows_keeps_its_digits_far_from_its_start():
    rng = np.random.default_rng(4)
    columns = np.where(np.arange(40) < 12, 0.0, 1000.0) + rng.normal(0, 0.01, 40)
    columns, spread = columns.astype(np.float32), np.full(40, 1e-4, np.float32)
    weights = window(np.dtype(np.float32))
    mean, variance = np.empty(30, np.float32), np.empty(30, np.float32)
    _row_moments(columns, spread, weights, mean, variance)
    share = weights.astype(np.float64) / weights.sum(dtype=np.float64)
    for i in range(12, 30):
        part = columns[i : i + TAPS].astype(np.float64)
        assert variance[i] == pytest.approx(1e-4 + share @ (part - share @ part) ** 2, rel=1e-2)
