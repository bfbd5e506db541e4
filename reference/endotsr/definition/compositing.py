"""Equation (B5): front-to-back compositing, one Gaussian at a time over whole images."""

from collections import namedtuple

import numpy as np

Composite = namedtuple("Composite", "colour depth opacity transmittance")  # (3, H, W), then (H, W) each.
Layer = namedtuple("Layer", "index dx dy value alpha front taken")  # One Gaussian; (H, W) each but index.
CompositeSaved = namedtuple("CompositeSaved", "projected opacity_logit colour settings background layers transmittance")
CompositeGrads = namedtuple("CompositeGrads", "d_mean2d d_covariance2d d_opacity_logit d_colour d_depth d_background")


def opacity_of(logit):
    """1 / (1 + exp(-logit)), complex allowed, without overflow."""
    e = np.exp(np.where(logit.real < 0, logit, -logit))
    return np.where(logit.real < 0, e, 1) / (1 + e)


def reach(projected, opacity_logit, settings, size, axis):
    """(size, N) bool: the columns (axis 0) or rows (axis 1) that the support rule gives each Gaussian."""
    at = np.arange(size)[:, None]
    inside = SUPPORTS[settings.support](projected, opacity_logit, settings, at, axis)
    return projected.visible & inside


def reach_everywhere(projected, opacity_logit, settings, at, axis):
    """Preset `exact`: every pixel."""
    return np.ones(np.broadcast_shapes(at.shape, projected.visible.shape), bool)


def reach_ellipse(projected, opacity_logit, settings, at, axis):
    """Ruling "support": the box of the ellipse on which alpha reaches the cutoff, widened by more than rounding.

    alpha >= cutoff means (p - mu)^T Sigma^-1 (p - mu) <= r^2 = 2 ln(opacity / cutoff); the box has half sides r sqrt(a)
    and r sqrt(c).
    """
    centre, variance = projected.mean2d[axis].real, projected.covariance2d[2 * axis].real
    with np.errstate(divide="ignore"):
        squared = 2 * (-np.logaddexp(0, -opacity_logit.real) - np.log(settings.alpha_cutoff))
    half = np.sqrt(np.maximum(squared, 0) * variance)
    half = half + 1e-5 * (half + np.abs(centre)) + 1e-3
    return (squared >= 0) & (np.abs(at + 0.5 - centre) <= half)


def reach_tiles(projected, opacity_logit, settings, at, axis):
    """Preset `legacy`: tiles of 16 px around a square of three standard deviations of the longer axis, as in CUDA."""
    centre = projected.mean2d[axis].real
    middle = (projected.covariance2d[0] + projected.covariance2d[2]).real / 2
    longest = middle + np.sqrt(np.maximum(0.1, middle**2 - projected.determinant.real))
    radius = np.ceil(3 * np.sqrt(longest))
    first = np.trunc((centre - 0.5 - radius) / 16)
    last = np.trunc((centre - 0.5 + radius + 15) / 16)
    return (at // 16 >= first) & (at // 16 < last)


SUPPORTS = {"everywhere": reach_everywhere, "ellipse": reach_ellipse, "three_sigma_tiles": reach_tiles}


def seen(projected, opacity_logit, settings, width, height):
    """(N,) bool: the support contains a pixel of the image."""
    columns, rows = (reach(projected, opacity_logit, settings, n, axis) for axis, n in enumerate((width, height)))
    return columns.any(axis=0) & rows.any(axis=0)


def layers_of(projected, opacity_logit, settings, width, height):
    """The layers, front to back (equal depths by index), and the transmittance (H, W) behind all of them."""
    u, v = projected.mean2d
    a, b, c = projected.covariance2d
    opacity = opacity_of(opacity_logit)
    columns, rows = (reach(projected, opacity_logit, settings, n, axis) for axis, n in enumerate((width, height)))
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    t, live = np.ones((height, width)), np.ones((height, width), bool)
    layers = []
    for i in np.argsort(projected.depth.real, kind="stable"):  # ruling "order"
        box = np.outer(rows[:, i], columns[:, i])
        if not box.any():
            continue
        dx, dy = x - u[i], y - v[i]
        q = (c[i] * dx * dx - 2 * b[i] * dx * dy + a[i] * dy * dy) / projected.determinant[i]
        value = opacity[i] * np.exp(-q / 2)
        alpha = np.where(value.real > settings.alpha_max, settings.alpha_max, value)  # ruling "alpha clamp"
        wanted = live & box & ~(alpha.real < settings.alpha_cutoff)  # NaN is seen
        live = live & ~(wanted & ((t * (1 - alpha)).real < settings.transmittance_stop))
        layers.append(Layer(i, dx, dy, value, alpha, t, wanted & live))
        t = np.where(wanted & live, t * (1 - alpha), t)
    return layers, t


def composite_forward(projected, opacity_logit, colour, settings, background, width, height):
    """Equation (B5): Composite of Gaussians on the screen; colour (3, N), background (3,), logits (N,).

    The kernels divide the image into tiles. They write q as a sum of squares, which stays accurate for needles. A
    colour that is not finite reaches all pixels here, and in the kernels those near its Gaussian.
    """
    layers, t = layers_of(projected, opacity_logit, settings, width, height)
    image = t * background[:, None, None]
    depth = opacity = 0 * t
    for layer in layers:
        weight = np.where(layer.taken, layer.alpha * layer.front, 0)
        image = image + weight * colour[:, layer.index, None, None]
        depth = depth + weight * projected.depth[layer.index]
        opacity = opacity + weight
    saved = CompositeSaved(projected, opacity_logit, colour, settings, background, layers, t)
    return Composite(image, depth, opacity, t), saved


def composite_reverse(d_colour, d_depth, d_opacity, saved):
    """Reverse of (B5) from images: the recursion R_k, back to front, then d(-q/2)/dSigma, Sigma on the screen."""
    projected, logit, colour, settings, background, layers, t = saved
    out = CompositeGrads._make(np.zeros((*n, logit.size), t.dtype) for n in ((2,), (3,), (), (3,), (), ()))
    rest = (background[:, None, None] * d_colour).sum(axis=0)  # <g, R>: colour, depth and opacity behind the layer
    for i, dx, dy, value, alpha, front, taken in reversed(layers):
        own = np.einsum("c,chw->hw", colour[:, i], d_colour) + projected.depth[i] * d_depth + d_opacity
        passes = taken & ~(value > settings.alpha_max)  # ruling "alpha clamp": gradient 0 where it is active
        power = np.where(passes, value * front * (own - rest), 0)  # by -q/2; (9.3), (9.6)
        (a, b, c), det = projected.covariance2d[:, i], projected.determinant[i]
        px, py = (c * dx - b * dy) / det, (a * dy - b * dx) / det  # Sigma^-1 d; (9.7)
        out.d_mean2d[:, i] = (power * px).sum(), (power * py).sum()
        out.d_covariance2d[:, i] = np.array([power * px**2 / 2, power * px * py, power * py**2 / 2]).sum((1, 2))
        out.d_opacity_logit[i] = power.sum() * opacity_of(-logit[i])
        weight = np.where(taken, alpha * front, 0)
        out.d_colour[:, i], out.d_depth[i] = (weight * d_colour).sum((1, 2)), (weight * d_depth).sum()  # (9.5)
        rest = np.where(taken, alpha * own + (1 - alpha) * rest, rest)  # (9.1)
    return out._replace(d_background=(d_colour * t).sum((1, 2)))
