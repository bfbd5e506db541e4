"""Equation (B9): smooth depth on tissue, small total variation under the instruments."""

from collections import namedtuple

import numpy as np

SmoothnessSaved = namedtuple("SmoothnessSaved", "rendered_depth rendered mask edges total_variation_factor")
SmoothnessGrads = namedtuple("SmoothnessGrads", "d_rendered d_rendered_depth")


def steps_reverse(d_steps, axis):
    """Adjoint of the differences of neighbours along an axis."""
    border = [(0, 0)] * d_steps.ndim
    border[axis] = (1, 1)
    return -np.diff(np.pad(d_steps, border), axis=axis)  # (11.10)


def squared_steps(depth, smooth):
    """Q and its derivative (H, W): squared steps between smooth neighbours, over 1e-6 + the number of smooth pixels."""
    total = 0.0
    gradient = np.zeros_like(depth)
    number = smooth.sum() + 1e-6
    for axis in (0, 1):
        both = np.minimum(np.roll(smooth, -1, axis), smooth).take(range(smooth.shape[axis] - 1), axis)
        step = np.where(both, np.diff(depth, axis=axis), 0)
        total = total + (step**2).sum() / number
        gradient = gradient + steps_reverse(2 * step / number, axis)
    return total, gradient


def total_variation(image, mask):
    """TV of an image (C, H, W), set to 0 on tissue first, and its derivative, 0 on tissue; sign(0) = 0."""
    outside = np.where(mask, 0, image)
    total = 0.0
    gradient = np.zeros_like(outside)
    for axis in (1, 2):
        step = np.diff(outside, axis=axis)
        total = total + np.abs(step).sum()
        gradient = gradient + steps_reverse(np.sign(step), axis)
    return total / image.size, np.where(mask, 0, gradient) / image.size  # (11.11)


def smoothness_forward(rendered_depth, rendered, mask, edges, total_variation_factor):
    """Equation (B9): squared steps of the depth (H, W), none to a pixel of `edges` (H, W), and two total variations."""
    loss = squared_steps(rendered_depth, mask & ~edges)[0]
    if total_variation_factor:
        variation = total_variation(rendered_depth[None], mask)[0] + total_variation(rendered, mask)[0]
        loss = loss + total_variation_factor * variation
    return loss, SmoothnessSaved(rendered_depth, rendered, mask, edges, total_variation_factor)


def smoothness_reverse(d_loss, saved):
    """Reverse of (B9)."""
    depth, rendered, mask, edges, factor = saved
    d_depth, d_image = squared_steps(depth, mask & ~edges)[1], np.zeros_like(rendered)
    if factor:
        d_depth = d_depth + factor * total_variation(depth[None], mask)[1][0]
        d_image = factor * total_variation(rendered, mask)[1]
    return SmoothnessGrads(d_loss * d_image, d_loss * d_depth)
