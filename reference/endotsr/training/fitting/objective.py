"""The objective of one training view, equation (6), and its gradient with respect to the rendered images.

L = (1 - w) L1 + w (1 - SSIM) + depth + smoothness + lambda_msp L_msp + lambda_lap(iteration) L_lap

The Matern penalty acts on coefficients, not on images, and is added in `view_gradients` and by the trainer.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import canny_edges
from endotsr.clips.sequences.sequence import Frame, Sequence
from endotsr.config import Config, LossConfig
from endotsr.method.equations.calibration import Calibration, ViewRms, calibrate, calibration_views, rms
from endotsr.method.equations.laplacian import (
    LEVELS,
    SupportMasks,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    support_masks,
)
from endotsr.method.equations.pyramid import Upsampling
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.threads import parallel_calls
from endotsr.method.kernels.timer import NO_TIMER, Timer, timed
from endotsr.method.losses.depth import DepthTarget, depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.masked_ssim import SsimTarget, masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.method.splatting.render import RenderOut
from endotsr.training.fitting.model import Spectral, camera_at, render_at
from endotsr.training.scene.gaussians import Gaussians
from endotsr.training.scene.parameters import FrameParameters

TIMED_AS = {"depth": "depth and smoothness", "smoothness": "depth and smoothness", "laplacian": "pyramid"}


class Targets(NamedTuple):
    """Inputs of the losses for one frame; None for a disabled term. `TrainingConstants` says which parts are cached."""

    image: FloatArray  # (3, H, W) observed, 0 outside the tissue
    mask: NDArray[np.bool_]  # (H, W) True = tissue
    ssim: SsimTarget | None
    depth: DepthTarget | None
    supports: SupportMasks | None


class LossWeights(NamedTuple):
    """Weights at one iteration; 0 = the term is not evaluated."""

    ssim: float
    depth: float
    smoothness: float
    laplacian: float


def full_weights(loss: LossConfig, laplacian: float) -> LossWeights:
    """The weights of all terms without their schedules; `laplacian` is lambda_lap, stated or calibrated."""
    return LossWeights(loss.ssim_weight, loss.depth_weight, loss.smoothness_weight, laplacian)


class ImageLoss(NamedTuple):
    """Value, terms and gradient with respect to the images."""

    loss: float
    terms: dict[str, float]  # unweighted, by the names of `LossTerms`; only those evaluated
    d_colour: FloatArray  # (3, H, W)
    d_depth: FloatArray  # (H, W)


def joined_targets(
    target: SsimTarget, depth: DepthTarget | None, supports: SupportMasks | None, config: Config
) -> Targets:
    """The targets of one frame, from its masked image, depth target and pyramid supports."""
    # the SSIM target has the only copy of the image, zero outside tissue
    return Targets(target.image, target.mask, target if config.loss.ssim_weight > 0 else None, depth, supports)


def optional_depth_target(depth: FloatArray, mask: NDArray[np.bool_], config: Config) -> DepthTarget | None:
    """`depth_target`, or None if the depth loss is disabled."""
    return depth_target(depth, mask) if config.loss.depth_weight > 0 else None


def frame_targets(frame: Frame, config: Config) -> Targets:
    """Masked target image, depth target and pyramid supports of one frame."""
    depth = optional_depth_target(frame.depth, frame.mask, config)
    supports = support_masks(frame.mask, LEVELS, config.loss.upsampling) if config.model.laplacian else None
    return joined_targets(ssim_target(frame.image, frame.mask), depth, supports, config)


def photometric_loss(colour: FloatArray, targets: Targets, ssim_weight: float) -> ImageLoss:
    """(1 - w) masked L1 + w (1 - masked SSIM) and its gradient with respect to the unclamped render."""
    l1, l1_saved = masked_l1_forward(colour, targets.image, targets.mask)
    loss, terms = (1.0 - ssim_weight) * l1, {"l1": l1}
    d_colour = masked_l1_reverse(1.0 - ssim_weight, l1_saved)
    if ssim_weight > 0 and targets.ssim is not None:
        ssim, ssim_saved = masked_ssim_forward(colour, targets.ssim)
        loss += ssim_weight * (1.0 - ssim)
        terms["ssim"] = ssim
        d_colour += masked_ssim_reverse(-ssim_weight, ssim_saved)
    return ImageLoss(loss, terms, d_colour, np.zeros((0, 0), colour.dtype))


class Term(NamedTuple):
    """One weighted term; None for a gradient that is always zero."""

    value: float  # unweighted
    d_colour: FloatArray | None
    d_depth: FloatArray | None


def depth_term(rendered: RenderOut, target: DepthTarget, weight: float) -> Term:
    """Normalised depth."""
    value, saved = normalised_depth_forward(rendered.depth, target)
    return Term(value, None, normalised_depth_reverse(weight, saved))


def smoothness_term(
    rendered: RenderOut, mask: NDArray[np.bool_], weight: float, factor: float, edges: NDArray[np.bool_] | None
) -> Term:
    """Smoothness of the depth away from its edges (None = Canny edges of this depth), and total variation."""
    edges = canny_edges(rendered.depth) if edges is None else edges
    value, saved = smoothness_forward(rendered.depth, rendered.colour, mask, edges, factor)
    smooth = smoothness_reverse(weight, saved)
    return Term(value, smooth.d_rendered, smooth.d_rendered_depth)


def laplacian_term(
    colour: FloatArray, image: FloatArray, supports: SupportMasks, weight: float, rule: Upsampling
) -> Term:
    """The Laplacian loss, equation (5), between the bands of two pyramids."""
    value, saved = laplacian_loss_forward(colour, image, supports, rule)
    return Term(value, laplacian_loss_reverse(weight, saved), None)


def image_loss(
    rendered: RenderOut,
    targets: Targets,
    weights: LossWeights,
    config: LossConfig,
    edges: NDArray[np.bool_] | None = None,
    *,
    timer: Timer = NO_TIMER,
) -> ImageLoss:
    """All image terms of equation (6) for one view, computed concurrently and added in the order of the equation.

    edges   (H, W) bool, where the depth is not smoothed; None = Canny edges of the rendered depth. Held fixed in both
            cases: no gradient flows through the edges.
    timer   records the stages "L1 and SSIM", "pyramid" and "depth and smoothness"

    Edges: a term with weight 0 or target None is not evaluated and not listed in `terms`.
    """
    colour, (image, mask, _, depth, supports) = rendered.colour, targets
    calls: dict[str, Callable[[], Term]] = {}
    if weights.depth > 0 and depth is not None:
        calls["depth"] = lambda: depth_term(rendered, depth, weights.depth)
    if weights.smoothness > 0:
        factor = config.total_variation_factor
        calls["smoothness"] = lambda: smoothness_term(rendered, mask, weights.smoothness, factor, edges)
    if weights.laplacian > 0 and supports is not None:
        calls["laplacian"] = lambda: laplacian_term(colour, image, supports, weights.laplacian, config.upsampling)
    photometric, *others = parallel_calls(
        timed(timer, "L1 and SSIM", lambda: photometric_loss(colour, targets, weights.ssim)),
        *(timed(timer, TIMED_AS[name], call) for name, call in calls.items()),
    )
    loss, terms, d_colour = photometric.loss, photometric.terms, photometric.d_colour
    d_depth = np.zeros_like(rendered.depth)
    for name, term in zip(calls, others, strict=True):
        loss += getattr(weights, name) * term.value
        terms[name] = term.value
        if term.d_colour is not None:
            d_colour += term.d_colour
        if term.d_depth is not None:
            d_depth += term.d_depth
    return ImageLoss(loss, terms, d_colour, d_depth)


def calibrate_on(
    gaussians: Gaussians,
    spectral: Spectral,
    sequence: Sequence,
    config: Config,
    frames: FrameParameters | None = None,
) -> Calibration:
    """Equation (7) on a trained scene: lambda_lap from the image gradients of up to `loss.calibration_views` views.

    The views are always rendered without the spectral components, because equation (7) is defined on the base model.
    The frame parameters `frames` belong to the base model.

    Raises: CalibrationError with a table of the views if no view has a ratio.
    """
    chosen = sequence.train_index[calibration_views(len(sequence.train_index), config.loss.calibration_views)]
    views = []
    for index in chosen:
        frame = sequence.frame(int(index), gaussians.position.dtype)
        at = (camera_at(frames, frame.camera, frame.time), frame.time)
        rendered = render_at(gaussians, spectral, config, *at, frames=frames, appearance=False, spectral_motion=False)
        targets = frame_targets(frame, config)
        supports = targets.supports or support_masks(frame.mask, LEVELS, config.loss.upsampling)
        photometric = photometric_loss(rendered.colour, targets, config.loss.ssim_weight)
        _, saved = laplacian_loss_forward(rendered.colour, targets.image, supports, config.loss.upsampling)
        laplacian = laplacian_loss_reverse(1.0, saved)
        views.append(ViewRms(sequence.names[int(index)], rms(photometric.d_colour), rms(laplacian)))
    return calibrate(views, config.loss.gradient_ratio)
