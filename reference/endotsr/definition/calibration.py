"""Equation (7): the weight of the Laplacian loss whose gradient is a given fraction of the photometric one."""

from collections import namedtuple

import numpy as np

Calibration = namedtuple("Calibration", "lambda_lap ratios")  # The weight, and the ratio of every valid view.


def rms(gradient):
    """Equation (7): root mean square of a gradient image over all pixels, masked ones included."""
    return np.sqrt((gradient**2).mean())  # (12.2)


def calibration_views(n_train, count):
    """Distinct ascending positions within n_train training frames, rounded half to even; none without a frame."""
    return np.unique(np.round(np.linspace(0, n_train - 1, count if n_train else 0)).astype(int))


def calibrate(views, gradient_ratio):
    """Equation (7): from (name, g_rgb, g_lap) of every view. One without g_rgb > 0 and a finite ratio >= 0 is dropped.

    Raises: ValueError if no view remains, or the median is 0 or too small to divide by.
    """
    ratios = [fine / rgb for _, rgb, fine in views if 0 < rgb < np.inf]
    ratios = np.array([ratio for ratio in ratios if 0 <= ratio < np.inf])  # (12.6)
    median = np.median(ratios) if ratios.size else 0.0
    if median == 0 or not np.isfinite(gradient_ratio / median):
        raise ValueError("calibration: no view has a ratio, or their median is 0 or too small")
    return Calibration(gradient_ratio / median, ratios)  # (12.3), (12.4)
