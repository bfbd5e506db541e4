"""Equation (B8): normalised depth loss."""

from collections import namedtuple

import numpy as np

DepthTarget = namedtuple("DepthTarget", "normalised valid count")  # The part that belongs to the frame.
# The render, its largest depth (0 = no loss) and the signs of the residuals.
DepthSaved = namedtuple("DepthSaved", "rendered_depth largest sign count")


def depth_target(prior_depth, mask):
    """Prior depth (H, W) in scene units; 0, negative or not finite = no depth."""
    known = np.isfinite(prior_depth) & (prior_depth > 0)
    prior = np.where(known, prior_depth, 0)
    return DepthTarget(prior / (prior.max() or 1), known & mask, (known & mask).sum())


def normalised_depth_forward(rendered_depth, target):
    """Equation (B8): both depths over their own maximum; 0 with fewer than 10 valid pixels or nothing rendered."""
    largest = np.where(np.isfinite(rendered_depth), rendered_depth, 0).max()
    if target.count < 10 or largest <= 0:
        return 0.0, DepthSaved(rendered_depth, 0.0, 0 * target.normalised, 1)
    residual = np.where(target.valid, rendered_depth / largest - target.normalised, 0)
    saved = DepthSaved(rendered_depth, largest, np.sign(residual), target.count)
    return np.abs(residual).sum() / target.count, saved


def normalised_depth_reverse(d_loss, saved):
    """Reverse of (B8): d_rendered_depth (H, W); that of the maximum is shared by the pixels that hold it."""
    depth, largest, sign, count = saved
    if largest == 0:
        return np.zeros_like(depth)
    holders = depth == largest
    d_largest = -(sign * np.where(sign == 0, 0, depth)).sum() / largest**2  # (10.9)
    return d_loss / count * (sign / largest + holders * d_largest / holders.sum())  # (10.8)
