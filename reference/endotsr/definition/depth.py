"""Equation (B8): normalised depth loss."""

from collections import namedtuple

import numpy as np

DepthTarget = namedtuple("DepthTarget", "normalised valid count")  # Precomputed once per frame.
# The render, its largest depth (0 = no loss) and the signs of the residuals.
DepthSaved = namedtuple("DepthSaved", "rendered_depth largest sign count")


def depth_target(prior_depth, mask):
    """Prior depth (H, W) in scene units; 0, negative or not finite = no depth. The maximum is of the whole image."""
    known = np.isfinite(prior_depth) & (prior_depth > 0)
    prior = np.where(known, prior_depth, 0)
    return DepthTarget(prior / (prior.max() or 1), known & mask, (known & mask).sum())


def normalised_depth_forward(rendered_depth, target):
    """Equation (B8): each depth is divided by its maximum; 0 below 10 valid pixels or for an empty render.

    The maximum is over the finite depths of the whole image, excluded pixels included.
    """
    largest = np.where(np.isfinite(rendered_depth), rendered_depth, 0).max()
    if target.count < 10 or largest <= 0:
        return 0.0, DepthSaved(rendered_depth, 0.0, 0 * target.normalised, 1)
    residual = np.where(target.valid, rendered_depth / largest - target.normalised, 0)
    saved = DepthSaved(rendered_depth, largest, np.sign(residual), target.count)
    return np.abs(residual).sum() / target.count, saved


def normalised_depth_reverse(d_loss, saved):
    """Reverse of (B8): d_rendered_depth (H, W). Pixels that tie for the maximum share its gradient equally."""
    depth, largest, sign, count = saved
    if largest == 0:
        return np.zeros_like(depth)
    holders = depth == largest
    d_largest = -(sign * np.where(sign == 0, 0, depth)).sum() / largest**2  # (11.9)
    return d_loss / count * (sign / largest + holders * d_largest / holders.sum())  # (11.8)
