"""Equation (B7): masked structural similarity, as displayed."""

from collections import namedtuple

import numpy as np

SsimTarget = namedtuple("SsimTarget", "image mask count")  # the observed frame, 0 outside tissue; C x tissue pixels
SsimSaved = namedtuple("SsimSaved", "x map slopes target")  # slopes: of the map by mu_x, k * x^2 and k * (x y)

C1, C2 = 0.01**2, 0.03**2


def blurred(image):
    """k * image (C, H, W): the window kappa kappa^T of 11 x 11 pixels, zeros outside the image."""
    for axis in (1, 2):
        n = image.shape[axis]
        offset = np.arange(n)[:, None] - np.arange(n)
        kappa = np.where(np.abs(offset) <= 5, np.exp(-(offset**2) / (2 * 1.5**2)), 0)
        kappa = kappa / np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2)).sum()
        image = np.moveaxis(np.moveaxis(image, axis, -1) @ kappa, -1, axis)
    return image


def ssim_target(observed, mask):
    """The part that depends on the frame only."""
    return SsimTarget(np.where(mask, observed, 0), mask, len(observed) * mask.sum())


def masked_ssim_forward(rendered, target):
    """Equation (B7): mean of the map over tissue, in [-1, 1]; 1 without tissue.

    The kernel computes 1 - s from the difference and the sum of the images, with variances about the window's centre.
    """
    x, y = np.where(target.mask, rendered, 0), target.image
    mu_x, mu_y = blurred(x), blurred(y)
    a1 = 2 * mu_x * mu_y + C1
    a2 = 2 * (blurred(x * y) - mu_x * mu_y) + C2
    b1 = mu_x**2 + mu_y**2 + C1
    b2 = blurred(x**2) - mu_x**2 + blurred(y**2) - mu_y**2 + C2
    s = a1 * a2 / (b1 * b2)
    by_mean = 2 * mu_y * (a2 - a1) / (b1 * b2) - 2 * mu_x * s * (1 / b1 - 1 / b2)  # (11.4)
    mean = np.where(target.mask, s, 0).sum() / target.count if target.count else 1.0
    return mean, SsimSaved(x, s, (by_mean, -s / b2, 2 * a1 / (b1 * b2)), target)  # (11.5), (11.6)


def masked_ssim_reverse(d_ssim, saved):
    """Reverse of (B7): d_rendered (C, H, W). The window is symmetric, so it is its own adjoint."""
    x, _, slopes, (y, mask, count) = saved
    u, u_xx, u_xy = (blurred(np.where(mask, d_ssim * slope / max(count, 1), 0)) for slope in slopes)
    return np.where(mask, u + 2 * x * u_xx + y * u_xy, 0)  # (11.7)
