"""Equation (B6): masked L1."""

from collections import namedtuple

import numpy as np

# The difference on tissue, and its number of entries there.
MaskedL1Saved = namedtuple("MaskedL1Saved", "difference count")


def masked_l1_forward(rendered, observed, mask):
    """Equation (B6): mean absolute difference (C, H, W) over tissue, mask (H, W) True; 0 without tissue."""
    difference = np.where(mask, rendered, 0) - np.where(mask, observed, 0)
    count = len(rendered) * mask.sum()
    return np.abs(difference).sum() / max(count, 1), MaskedL1Saved(difference, count)


def masked_l1_reverse(d_loss, saved):
    """Reverse of (B6): d_rendered (C, H, W); sign(0) = 0."""
    return d_loss * np.sign(saved.difference) / max(saved.count, 1)  # (11.1)
