"""PSNR (M1), SSIM (M2), 8-bit rounding and means (E4)."""

import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from endotsr.definition import metrics as definition
from endotsr.results.evaluation.metrics import (
    image_metrics,
    mean_metrics,
    psnr,
    psnr_tissue,
    round_8bit,
    ssim_full,
    ssim_tissue,
)

NAMES = ["psnr_full", "psnr_tissue", "ssim_full", "ssim_tissue"]


def case(noise=0.02, shape=(3, 14, 19)):
    rng = np.random.default_rng(4)
    truth = round_8bit(rng.uniform(0.1, 0.9, shape))
    mask = np.ones(shape[1:], bool)
    mask[3:9, 8:] = False
    return np.clip(truth + noise * rng.standard_normal(shape), 0, 1), truth, mask


@pytest.mark.parametrize("noise", [0.002, 0.02, 0.2])
def test_full_can_be_the_lower_ssim(noise):
    """The error lies beside a single excluded pixel in every window: its own value is low, and counts in full."""
    truth, mask = np.full((3, 33, 33), 0.5), np.ones((33, 33), bool)
    mask[16, 16], render = False, truth.copy()
    render[:, 15:18, 15:18] += noise
    assert ssim_full(render, truth, mask) < ssim_tissue(render, truth, mask)


def test_psnr_equals_skimage():
    render, truth, mask = case()
    zeroed = [np.where(mask, a, 0) for a in (truth, render)]
    assert psnr(render, truth, mask) == pytest.approx(peak_signal_noise_ratio(*zeroed, data_range=1), abs=1e-10)
    on_tissue = peak_signal_noise_ratio(truth[:, mask], render[:, mask], data_range=1)
    assert psnr_tissue(render, truth, mask) == pytest.approx(on_tissue, abs=1e-10)


def test_full_is_tissue_plus_the_share_of_the_mask():
    render, truth, mask = case()
    gain = -10 * math.log10(mask.mean())
    assert psnr(render, truth, mask) - psnr_tissue(render, truth, mask) == pytest.approx(gain, abs=1e-10)


def test_every_metric_equals_its_definition():
    render, truth, mask = case()
    for metric in (psnr, psnr_tissue, ssim_full, ssim_tissue):
        expected = getattr(definition, metric.__name__)(render, truth, mask)
        assert metric(render, truth, mask) == pytest.approx(expected, abs=1e-12), metric


def test_ssim_equals_skimage():
    """With Gaussian windows and a dark rim skimage's definition is ours: both ways of padding see zeros."""
    rng = np.random.default_rng(8)
    render, truth = (rng.uniform(0.1, 0.9, (3, 48, 56)) for _ in range(2))
    mask = np.zeros((48, 56), bool)
    mask[12:-12, 12:-12] = True
    mask[20:25, 30:36] = False  # an instrument
    zeroed = [np.where(mask, picture, 0.0) for picture in (render, truth)]
    how = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1.0}
    _, found = structural_similarity(*zeroed, channel_axis=0, full=True, **how)
    assert ssim_full(render, truth, mask) == pytest.approx(found.mean(), abs=1e-10)
    assert ssim_tissue(render, truth, mask) == pytest.approx(found[:, mask].mean(), abs=1e-10)


def test_float32_input_is_measured_in_float64():
    render, truth, mask = (case()[0].astype(np.float32), *case()[1:])
    for measure in (psnr, psnr_tissue, ssim_full, ssim_tissue):
        assert measure(render, truth, mask) == measure(render.astype(float), truth, mask)


def test_rounding_is_half_up_and_clips():
    levels = np.array([-0.2, 0.0, 0.49999 / 255, 0.5 / 255, 1.5 / 255, 2.5 / 255, 254.5 / 255, 1.0, 1.7])
    assert np.array_equal(round_8bit(levels) * 255, [0, 0, 0, 1, 2, 3, 255, 255, 255])


def test_image_metrics_holds_both_columns():
    render, truth, mask = case()
    found = image_metrics(render, truth, mask)
    assert list(found) == NAMES + [f"{name}_8bit" for name in NAMES]
    assert found["psnr_tissue"] == psnr_tissue(render, truth, mask)
    assert found["psnr_tissue_8bit"] == psnr_tissue(round_8bit(render), truth, mask)
    assert found["ssim_full_8bit"] == ssim_full(round_8bit(render), truth, mask)


def test_a_render_out_of_range_is_clipped():
    render, truth, mask = case()
    bright = np.where(truth > 0.5, 3.0, render)
    assert image_metrics(bright, truth, mask) == image_metrics(np.clip(bright, 0, 1), truth, mask)


def test_hard_E4_identical_images_are_infinite():
    _, truth, mask = case()
    found = image_metrics(truth.astype(np.float32), truth, mask)  # float32 of k / 255 rounds back to k
    assert found["psnr_full_8bit"] == found["psnr_tissue_8bit"] == math.inf
    assert psnr(truth, truth.copy(), mask) == psnr_tissue(truth, truth.copy(), mask) == math.inf
    assert ssim_full(truth, truth.copy(), mask) == ssim_tissue(truth, truth.copy(), mask) == 1.0


def test_hard_E4_empty_mask_is_nan():
    render, truth, mask = case()
    assert all(math.isnan(value) for value in image_metrics(render, truth, np.zeros_like(mask)).values())


def test_hard_E4_means_leave_out_and_count():
    rows = [{"psnr_full": 30.0, "lpips": None}, {"psnr_full": math.inf, "lpips": None}]
    rows += [{"psnr_full": math.nan, "lpips": None}, {"psnr_full": 40.0, "lpips": None}]
    assert mean_metrics(rows) == {
        "images": 4,
        "psnr_full": 35.0,  # the mean of dB, not the dB of a mean error
        "psnr_full_excluded": 2,
        "lpips": None,
        "lpips_excluded": 4,
    }
    assert mean_metrics([]) == {"images": 0}


def test_hard_E4_what_8bit_rounding_costs():
    """Rounding adds 1/12 of a squared level: a cap of 58.9 dB, and 0.055 dB at 40 dB."""
    rng = np.random.default_rng(6)
    truth = rng.uniform(0.2, 0.8, (3, 120, 120))
    mask = np.ones((120, 120), bool)
    assert psnr(round_8bit(truth), truth, mask) == pytest.approx(10 * math.log10(12 * 255**2), abs=0.05)
    render = round_8bit(truth) + 0.01 * rng.standard_normal(truth.shape)
    found = image_metrics(render, round_8bit(truth), mask)
    assert found["psnr_full"] - found["psnr_full_8bit"] == pytest.approx(0.055, abs=0.01)


def test_hard_L6_nothing_under_the_mask_matters():
    render, truth, mask = case()
    bad = image_metrics(np.where(mask, render, np.nan), np.where(mask, truth, np.inf), mask)
    assert bad == image_metrics(render, truth, mask)


def test_nan_on_tissue_is_not_hidden():
    render, truth, mask = case()
    render[1, 0, 0] = np.nan
    assert all(math.isnan(value) for value in image_metrics(render, truth, mask).values())


def test_refuses_masks_that_are_not_boolean():
    render, truth, mask = case()
    with pytest.raises(ValueError, match="boolean"):
        psnr(render, truth, 255 * mask.astype(np.uint8))


def test_a_float32_truth_is_the_same_8bit_image():
    render, truth, mask = case()
    narrow, wide = image_metrics(render, truth.astype(np.float32), mask), image_metrics(render, truth, mask)
    assert narrow["psnr_full_8bit"] == wide["psnr_full_8bit"]
