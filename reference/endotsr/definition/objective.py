"""Equation (6): the objective of one view and its gradient with respect to the rendered images."""

from collections import namedtuple

import numpy as np

from endotsr.definition.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.definition.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.definition.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.definition.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.definition.smoothness import smoothness_forward, smoothness_reverse

Frame = namedtuple("Frame", "image mask depth time camera")
Targets = namedtuple("Targets", "image mask ssim depth supports")  # precomputed once per frame
LossWeights = namedtuple("LossWeights", "ssim depth smoothness laplacian")  # in force at this iteration
ImageLoss = namedtuple("ImageLoss", "loss terms d_colour d_depth")


def full_weights(loss, laplacian):
    """The weights of all terms without their schedules; `laplacian` is lambda_lap."""
    return LossWeights(loss.ssim_weight, loss.depth_weight, loss.smoothness_weight, laplacian)


def frame_targets(frame, config):
    """Targets of a Frame: image (3, H, W), mask (H, W), prior depth (H, W)."""
    target = ssim_target(frame.image, frame.mask)
    supports = support_masks(frame.mask, 3, config.loss.upsampling)
    return Targets(target.image, frame.mask, target, depth_target(frame.depth, frame.mask), supports)


def photometric_loss(colour, targets, ssim_weight):
    """(1 - w) L1 + w (1 - SSIM), the terms, and the derivative with respect to the render (3, H, W)."""
    l1, l1_saved = masked_l1_forward(colour, targets.image, targets.mask)
    ssim, ssim_saved = masked_ssim_forward(colour, targets.ssim)
    d_colour = masked_l1_reverse(1 - ssim_weight, l1_saved) + masked_ssim_reverse(-ssim_weight, ssim_saved)
    return (1 - ssim_weight) * l1 + ssim_weight * (1 - ssim), {"l1": l1, "ssim": ssim}, d_colour


def no_edges(depth):
    """No edges, instead of a Canny edge map, which has no closed formula."""
    return np.zeros(depth.shape, bool)


def image_loss(rendered, targets, weights, config, edges=no_edges):
    """Equation (6) without the Matern penalty; `edges` (H, W) bool, or a function that detects them in the depth."""
    colour = rendered.colour
    depth = rendered.depth
    loss, terms, d_colour = photometric_loss(colour, targets, weights.ssim)
    d_depth = np.zeros_like(depth)
    if weights.depth > 0:
        terms["depth"], saved = normalised_depth_forward(depth, targets.depth)
        d_depth = d_depth + normalised_depth_reverse(weights.depth, saved)
    if weights.smoothness > 0:
        found = edges(depth) if callable(edges) else edges
        factor = config.total_variation_factor
        terms["smoothness"], saved = smoothness_forward(depth, colour, targets.mask, found, factor)
        by_colour, by_depth = smoothness_reverse(weights.smoothness, saved)
        d_colour = d_colour + by_colour
        d_depth = d_depth + by_depth
    if weights.laplacian > 0:
        terms["laplacian"], saved = laplacian_loss_forward(colour, targets.image, targets.supports, config.upsampling)
        d_colour = d_colour + laplacian_loss_reverse(weights.laplacian, saved)
    loss += sum(getattr(weights, name) * terms[name] for name in terms if name not in ("l1", "ssim"))
    return ImageLoss(loss, terms, d_colour, d_depth)
