"""Equation (5): pyramid, support masks and the Laplacian loss, hard cases L1 to L8."""

import numpy as np
import pytest
from PIL import Image

from data_folder import data_folder
from endotsr.definition import laplacian as definition
from endotsr.method.equations import laplacian, pyramid
from endotsr.method.equations.laplacian import (
    laplacian_levels,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    pull_back,
    support_masks,
)
from endotsr.method.equations.pyramid import expand_image
from method.by_threads import assert_threads_change_no_bit
from oracle import laplacian_oracle as oracle

U = np.finfo(np.float64).eps / 2
RULES = ["co_sited", "half_pixel"]
DTYPES = [np.float32, np.float64]
SIZES = [(1, 1), (1, 7), (7, 1), (2, 2), (3, 5), (7, 9), (8, 8), (9, 9), (17, 31), (40, 33)]


def images(shape, dtype=np.float64, seed=0):
    rng = np.random.default_rng(seed)
    return rng.random((3, *shape)).astype(dtype), rng.random((3, *shape)).astype(dtype)


def mask_with_tool(shape):
    mask = np.ones(shape, bool)
    mask[shape[0] // 2 :, : shape[1] // 4] = False
    return mask


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", [*SIZES, (512, 640)])
def test_hard_L3_any_size_equals_the_definition(shape, rule):
    image = images(shape)[0]
    found = laplacian_levels(image, 3, rule)
    bands, coarse = definition.laplacian_levels(image, 3, rule)
    for a, b in zip((*found.bands, found.coarse), (*bands, coarse)):
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=0, atol=16 * U)
    expected = [shape]
    for _ in range(3):
        expected.append(tuple(-(-n // 2) for n in expected[-1]))
    assert [a.shape[1:] for a in (*found.bands, found.coarse)] == expected


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", SIZES)
def test_hard_L1_constant_image_has_no_bands(shape, rule, dtype):
    for band in laplacian_levels(np.full((3, *shape), 0.7, dtype), 3, rule).bands:
        assert np.abs(band).max() <= 2 * np.finfo(dtype).eps


def test_hard_L1_unit_ramp_tells_the_rules_apart():
    ramp = np.tile(np.arange(160.0), (1, 12, 1))
    for rule, steps in (("co_sited", (0, 0, 0)), ("half_pixel", (0.5, 1, 2))):
        for level, (band, step) in enumerate(zip(laplacian_levels(ramp, 3, rule).bands, steps)):
            inner = band[0, :, 40 >> level : 120 >> level]
            assert np.abs(np.abs(inner) - step).max() <= 8 * U * 160


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", SIZES)
def test_hard_L1_bands_telescope_to_the_image(shape, rule, dtype):
    image = images(shape, dtype)[0]
    levels = laplacian_levels(image, 3, rule)
    assert {level.dtype for level in (*levels.bands, levels.coarse)} == {np.dtype(dtype)}
    rebuilt = levels.coarse
    for band in reversed(levels.bands):
        rebuilt = band + expand_image(rebuilt, band.shape[1:], rule)
    assert np.abs(rebuilt - image).max() <= 4 * np.finfo(dtype).eps


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", [*SIZES, (61, 70)])
def test_hard_L4_masks_equal_impulse_response_and_float_mask(shape, rule):
    rng = np.random.default_rng(5)
    for share in (0.0, 0.002, 0.01, 0.2):
        mask = rng.random(shape) >= share
        found = support_masks(mask, 3, rule)
        assert np.array_equal(found.image, mask)
        written = definition.support_masks(mask, 3, rule).bands
        for band, text, impulse, dyadic in zip(
            found.bands, written, oracle.masks_by_impulse_response(mask, rule), oracle.masks_by_float(mask, rule)
        ):
            assert np.array_equal(band, text)
            assert np.array_equal(band, impulse)
            assert np.array_equal(band, dyadic)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 33])
def test_the_matrices_of_the_definition_are_the_filter_of_scipy_and_the_written_weights(n):
    np.testing.assert_array_equal(definition.reduce_matrix(n), oracle.reduce_matrix(n))
    for rule in RULES:
        np.testing.assert_array_equal(definition.expand_matrix(n, rule), oracle.expand_matrix(n, rule))


def valid_shares(mask, rule="co_sited"):
    return np.array([mask.mean(), *(band.mean() for band in support_masks(mask, 3, rule).bands)])


def test_hard_L4_what_isolated_bad_pixels_cost():
    """A hole of one pixel takes out a footprint: 60 holes cost level 3 a fifth of its values, the mask 0.02 %."""
    row, column = np.mgrid[0:512, 0:640]
    tools = (np.abs(column - 150 - 0.2 * row) < 30) & (row > 250) | (np.abs(column - 480 + 0.3 * row) < 35) & (
        row > 180
    )
    holes = tools.copy()
    holes[tuple(np.random.default_rng(8).integers(0, (512, 640), (60, 2)).T)] = True
    clean, spoilt = valid_shares(~tools), valid_shares(~holes)
    assert (np.diff(clean) < 0).all() and (np.diff(spoilt) < 0).all()
    lost = clean - spoilt
    assert lost[0] < 3e-4 and 0.002 < lost[1] < 0.01 < lost[2] < 0.06 < lost[3] < 0.2
    footprint = np.array([36, 225, 33**2]) * 60 / (512 * 640)  # 5-7, 13-17 and 29-37 pixels squared
    assert (lost[1:] < 1.3 * footprint).all() and (lost[1:] > 0.5 * footprint).all()


@pytest.mark.data
@pytest.mark.parametrize(
    "folder, frame, rule, shares",
    [
        ("masks", 0, "co_sited", (0.7066, 0.6837, 0.6431, 0.5507)),
        ("masks", 0, "half_pixel", (0.7066, 0.6796, 0.6341, 0.5316)),
        ("gt_masks", 31, "co_sited", (0.6646, 0.6523, 0.6297, 0.5863)),
        ("gt_masks", 31, "half_pixel", (0.6646, 0.6499, 0.6248, 0.5766)),
    ],
)
def test_hard_L4_valid_shares_of_real_masks(folder, frame, rule, shares):
    """Tissue, and the valid values of levels 1 to 3, as shares of all."""
    file = sorted((data_folder("endonerf_pulling") / folder).glob("*.png"))[frame]
    mask = np.asarray(Image.open(file).convert("L")) < 128  # white is excluded
    np.testing.assert_allclose(valid_shares(mask, rule), shares, atol=5e-5)


def test_hard_L4_footprints():
    assert oracle.footprint_lengths(160, "co_sited") == [{5, 7}, {13, 17}, {29, 37}]
    assert oracle.footprint_lengths(160, "half_pixel") == [{7}, {17}, {37}]
    for rule, radii in (("co_sited", (3, 8, 18)), ("half_pixel", (4, 9, 19))):
        mask = np.ones((1, 160), bool)
        mask[0, 79] = False
        for level, (band, radius) in enumerate(zip(support_masks(mask, 3, rule).bands, radii)):
            bad = np.flatnonzero(~band[0]) << level
            assert bad.min() >= 79 - radius - (1 << level) and bad.max() <= 79 + radius + (1 << level)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", SIZES)
def test_loss_and_gradient_equal_the_definition(shape, rule, dtype):
    rendered, observed = images(shape, dtype)
    masks = support_masks(mask_with_tool(shape), 3, rule)
    value, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    wide = rendered.astype(np.float64), observed.astype(np.float64)
    u = float(np.finfo(dtype).eps) / 2
    assert value == pytest.approx(definition.laplacian_loss_forward(*wide, masks, rule)[0], abs=16 * u)
    gradient = laplacian_loss_reverse(1.0, saved)
    assert gradient.dtype == dtype
    if dtype is np.float64 and min(shape) > 1:  # on a line the bands have exact ties at rounding level
        expected = definition.laplacian_loss_reverse(1.0, definition.laplacian_loss_forward(*wide, masks, rule)[1])
        np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("rule", RULES)
def test_hard_L5_empty_level(rule, dtype):
    rendered, observed = images((24, 20), dtype)
    mask = np.zeros((24, 20), bool)
    mask[4:13, 4:13] = True  # one valid sample of band 1, none of band 3
    masks = support_masks(mask, 3, rule)
    assert masks.counts[0] > 0 and masks.counts[2] == 0
    value, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    assert saved.weights[0] == 1 / (3 * 3 * masks.counts[0]) and saved.weights[2] == 0.0  # the 1/3 stays
    truth, _ = definition.laplacian_loss_forward(rendered.astype(float), observed.astype(float), masks, rule)
    assert value == pytest.approx(truth, rel=64 * float(np.finfo(dtype).eps))
    gradient = laplacian_loss_reverse(1.0, saved)
    assert gradient.any() and np.isfinite(gradient).all()


@pytest.mark.parametrize("rule", RULES)
def test_hard_L5_nothing_valid(rule):
    rendered, observed = images((9, 12))
    masks = support_masks(np.zeros((9, 12), bool), 3, rule)
    value, saved = laplacian_loss_forward(rendered * np.nan, observed, masks, rule)
    assert value == 0.0 and masks.counts == (0, 0, 0)
    assert np.array_equal(laplacian_loss_reverse(1.0, saved), np.zeros((3, 9, 12)))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("rule", RULES)
def test_hard_L6_nothing_under_the_instrument_matters(rule, dtype):
    rendered, observed = images((40, 33), dtype)
    mask = mask_with_tool((40, 33))
    masks = support_masks(mask, 3, rule)
    value, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    gradient = laplacian_loss_reverse(1.0, saved)
    for junk in (np.nan, np.inf, -np.inf, np.finfo(dtype).max):
        dirty, other = np.where(mask, rendered, dtype(junk)), np.where(mask, observed, dtype(-junk))
        again, saved = laplacian_loss_forward(dirty, other, masks, rule)
        assert again == value
        assert laplacian_loss_reverse(1.0, saved).tobytes() == gradient.tobytes()
    assert not gradient[:, ~mask].any()
    # nor does a tissue pixel that no valid footprint contains
    lonely = mask_with_tool((40, 33))
    lonely[38, 4] = True
    masks = support_masks(lonely, 3, rule)
    value, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    gradient = laplacian_loss_reverse(1.0, saved)
    assert not gradient[:, 38, 4].any()
    moved = rendered.copy()
    moved[:, 38, 4] += 5
    again, saved = laplacian_loss_forward(moved, observed, masks, rule)
    assert again == value and np.array_equal(laplacian_loss_reverse(1.0, saved), gradient)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("shape", SIZES)
def test_hard_L8_the_reverse_pass_is_the_adjoint(shape, rule):
    rng = np.random.default_rng(6)
    mask = rng.random(shape) > 0.1
    x = rng.normal(size=(3, *shape))
    bands = laplacian_levels(np.where(mask, x, 0.0), 3, rule).bands
    y = tuple(rng.normal(size=band.shape) for band in bands)
    scales = (0.3, 1.1, 0.7)
    pulled = pull_back(y, scales, mask, rule, np.dtype(np.float64))
    left = sum(s * np.vdot(band, field) for s, band, field in zip(scales, bands, y))
    size = np.linalg.norm(x) * sum(np.linalg.norm(field) for field in y)
    assert abs(left - np.vdot(x, pulled)) <= 1e-13 * size


@pytest.mark.parametrize("dtype", DTYPES)
def test_threads_agree(dtype):
    rendered, observed = images((70, 50), dtype)
    masks = support_masks(mask_with_tool((70, 50)))

    def compute():
        value, saved = laplacian_loss_forward(rendered, observed, masks)
        return value, laplacian_loss_reverse(1.0, saved)

    assert_threads_change_no_bit(compute)


@pytest.mark.parametrize("rule", RULES)
def test_kernels_equal_their_python_bodies(monkeypatch, rule):
    rendered, observed = images((11, 8))
    masks = support_masks(mask_with_tool((11, 8)), 3, rule)
    value, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    gradient = laplacian_loss_reverse(1.0, saved)
    for module, names in (
        (laplacian, ["_difference", "_band_signs", "_expand_adjoint", "_reduce_adjoint"]),
        (pyramid, ["_reduce", "_expand"]),
    ):
        for name in names:
            monkeypatch.setattr(module, f"{name}_kernel", getattr(module, name))
    again, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    assert again == pytest.approx(value, rel=2 * U)
    np.testing.assert_allclose(laplacian_loss_reverse(1.0, saved), gradient, rtol=4 * U, atol=1e-18)


def test_refused_input():
    rendered, observed = images((8, 8))
    masks = support_masks(np.ones((8, 8)))
    with pytest.raises(ValueError, match="disagree"):
        laplacian_loss_forward(rendered[:, :7], observed, masks)
    with pytest.raises(ValueError, match="in the masks"):
        laplacian_loss_forward(rendered, observed, masks, "half_pixel")
    with pytest.raises(ValueError, match="co_sited"):
        support_masks(np.ones((8, 8)), 3, "bicubic")
