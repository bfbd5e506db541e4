"""Masked L1 (B6)."""

import numpy as np

from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from method.losses.made_up_images import images, tool_mask

U32 = 2.0**-24


def test_float32_keeps_its_dtype_and_digits():
    rendered, observed = (a.astype(np.float32) for a in images())
    loss, saved = masked_l1_forward(rendered, observed, tool_mask())
    wide, _ = masked_l1_forward(rendered.astype(float), observed.astype(float), tool_mask())
    assert abs(loss - wide) <= 2 * U32 * 1.0  # one rounding of a difference of size <= 1
    assert masked_l1_reverse(1.0, saved).dtype == np.float32


def test_hard_L5_no_tissue_is_zero():
    rendered, observed = images()
    loss, saved = masked_l1_forward(rendered, observed, np.zeros(rendered.shape[1:], bool))
    assert loss == 0.0
    assert not masked_l1_reverse(1.0, saved).any()


def test_one_value_is_an_image():
    loss, saved = masked_l1_forward(np.full((1, 1, 1), 0.75), np.full((1, 1, 1), 0.25), np.ones((1, 1), bool))
    assert loss == 0.5
    assert masked_l1_reverse(3.0, saved) == 3.0
