"""The losses and the supports of the definition equal the compiled ones for any images and masks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endotsr.definition import laplacian as laplacian_definition
from endotsr.definition import masked_l1 as l1_definition
from endotsr.definition import masked_ssim as ssim_definition
from endotsr.method.equations import laplacian
from endotsr.method.losses import masked_l1, masked_ssim
from properties.strategies import SEEDS, masks, shapes

RULES = st.sampled_from(["co_sited", "half_pixel"])


@given(st.data(), shapes(), SEEDS)
def test_l1_and_ssim_and_their_gradients(data, shape, seed):
    rendered, observed = np.random.default_rng(seed).uniform(-0.2, 1.2, (2, 3, *shape))
    mask = data.draw(masks(shape))
    rendered[:, ~mask] = np.nan
    loss, saved = masked_l1.masked_l1_forward(rendered, observed, mask)
    text, text_saved = l1_definition.masked_l1_forward(rendered, observed, mask)
    assert loss == pytest.approx(text, rel=1e-13)
    np.testing.assert_array_equal(
        masked_l1.masked_l1_reverse(1.0, saved), l1_definition.masked_l1_reverse(1.0, text_saved)
    )
    value, saved = masked_ssim.masked_ssim_forward(rendered, masked_ssim.ssim_target(observed, mask))
    text, text_saved = ssim_definition.masked_ssim_forward(rendered, ssim_definition.ssim_target(observed, mask))
    assert value == pytest.approx(text, abs=1e-11)
    found, wanted = masked_ssim.masked_ssim_reverse(1.0, saved), ssim_definition.masked_ssim_reverse(1.0, text_saved)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * max(np.abs(wanted).max(), 1e-3))


@given(st.data(), shapes(40), RULES, SEEDS)
def test_the_laplacian_loss_and_its_supports(data, shape, rule, seed):
    rendered, observed = np.random.default_rng(seed).uniform(-0.2, 1.2, (2, 3, *shape))
    mask = data.draw(masks(shape))
    supports, text_supports = (room.support_masks(mask, 3, rule) for room in (laplacian, laplacian_definition))
    for one, other in zip(supports.bands, text_supports.bands, strict=True):
        np.testing.assert_array_equal(one, other)
    loss, _ = laplacian.laplacian_loss_forward(rendered, observed, supports, rule)
    text, _ = laplacian_definition.laplacian_loss_forward(rendered, observed, text_supports, rule)
    assert loss == pytest.approx(text, abs=1e-14)
