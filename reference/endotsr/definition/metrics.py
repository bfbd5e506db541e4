"""Equations (M1) and (M2): PSNR and SSIM of a render (3, H, W) against a frame; mask (H, W) True = tissue.

The caller clips the render to [0, 1]. Without tissue the values are those of empty means: infinity, NaN, 1 and 1.
"""

import numpy as np

from endotsr.definition.masked_ssim import masked_ssim_forward, ssim_target


def psnr(render, truth, mask):
    """Equation (M1): dB over the full image, excluded pixels 0."""
    return -10 * np.log10((np.where(mask, render - truth, 0) ** 2).mean())


def psnr_tissue(render, truth, mask):
    """Equation (M1): dB over tissue."""
    return -10 * np.log10(((render - truth)[:, mask] ** 2).mean())


def ssim_full(render, truth, mask):
    """Equation (M2): mean of the map over the full image, excluded pixels 0."""
    render, truth = np.where(mask, render, 0), np.where(mask, truth, 0)
    return masked_ssim_forward(render, ssim_target(truth, np.ones_like(mask)))[0]


def ssim_tissue(render, truth, mask):
    """Equation (M2): mean of the map over tissue."""
    return masked_ssim_forward(render, ssim_target(truth, mask))[0]
