"""Masked structural similarity of the render and the observed frame (B7).

With mu, sigma^2 the mean and variance under an 11 x 11 Gaussian window (sigma 1.5, zero padding), images x, y:

    SSIM = (2 mu_x mu_y + C1) (2 sigma_xy + C2) / ((mu_x^2 + mu_y^2 + C1) (sigma_x^2 + sigma_y^2 + C2))

Written with the difference e = x - y and the sum s = x + y, the same quantity is

    SSIM = P Q,   P = 1 - mu_e^2 / B1,   B1 = (mu_s^2 + mu_e^2) / 2 + C1,
                  Q = 1 - sigma_e^2 / B2, B2 = (sigma_s^2 + sigma_e^2) / 2 + C2

because B1 - A1 = (mu_x - mu_y)^2 and B2 - A2 is the variance of x - y (A1, A2 the factors of the numerator). This form
needs no covariance. For x = y it is exactly 1 with an exactly zero gradient. It is bitwise symmetric in x and y. For
x, y >= 0, 1 - SSIM = (1 - P) + P (1 - Q) has no negative term and keeps full relative precision. No moments of the
target are needed: only the masked target is cached.

Variances are sums of squares about the window's central value c,  sigma^2 = sum w (x - c)^2 - (sum w (x - c))^2,
first down columns, then along rows (variance of a mixture = mean of variances + variance of means). The central
weight w0 = 0.27 bounds the cancellation: sigma^2 >= w0 sum w (x - c)^2 in either pass. At most a factor 1/w0 of
relative precision is lost, at any brightness. The usual E[x^2] - E[x]^2 has no such bound.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.losses.rows import check_image, row_total

RADIUS = 5  # the window spans 11 pixels
TAPS = 2 * RADIUS + 1
WINDOW_SIGMA = 1.5  # pixels
C1 = 0.01**2  # (0.01 x display range)^2
C2 = 0.03**2  # (0.03 x display range)^2


class SsimTarget(NamedTuple):
    """The part that depends on the frame only and may be cached between iterations."""

    image: FloatArray  # (C, H, W)  observed, 0 where the mask is False
    mask: BoolArray  # (H, W)
    count: int  # C x tissue pixels


class SsimSaved(NamedTuple):
    """Arrays padded by RADIUS zeros on each side of both image axes."""

    difference: FloatArray  # (C, H + 10, W + 10)  e, 0 where the mask is False
    total: FloatArray  # (C, H + 10, W + 10)  s, 0 where the mask is False
    slopes: FloatArray  # (3, C, H + 10, W + 10)  coefficients of 1, 2 e and 2 s in d SSIM(pixel) / dx, 0 off tissue
    target: SsimTarget


def ssim_target(observed: FloatArray, mask: BoolArray) -> SsimTarget:
    """The observed frame (C, H, W) in display units set to 0 outside `mask` (True = tissue)."""
    observed = check_image("observed", observed, mask)
    image = np.where(mask, observed, observed.dtype.type(0))
    return SsimTarget(image, np.ascontiguousarray(mask), observed.shape[0] * int(np.count_nonzero(mask)))


def stored_target(levels: NDArray[np.unsignedinteger], largest: int, mask: BoolArray, dtype: DTypeLike) -> SsimTarget:
    """`ssim_target` of levels / largest in `dtype`, for an image stored as integers.

    levels   (C, H, W) uint8 or uint16 in [0, largest]
    """
    levels, real = check_image("levels", levels, mask), np.dtype(dtype).type
    image = np.empty(levels.shape, dtype)
    rows = levels.shape[0] * levels.shape[1]
    parallel_for(_unit_image_kernel, rows, levels, real(largest), np.ascontiguousarray(mask), image)
    return SsimTarget(image, np.ascontiguousarray(mask), levels.shape[0] * int(np.count_nonzero(mask)))


def masked_ssim_forward(rendered: FloatArray, target: SsimTarget) -> tuple[float, SsimSaved]:
    """Mean over channels and tissue pixels of the SSIM map of the two masked images (B7); see the module docstring.

    rendered  (C, H, W)  display units, not clamped
    target    of `ssim_target`
    returns   (mean SSIM in [-1, 1], saved); summed in float64

    Reverse: `masked_ssim_reverse`.
    Edges:   no tissue: 1 with zero gradient. Images smaller than the window are zero-padded as well. The step at the
             mask border exists in both images and enters the map.
    Raises:  ValueError if the shapes disagree.
    Oracle:  `endotsr.definition.masked_ssim`; scipy.ndimage.correlate with zero padding.
    Source:  Wang et al. 2004; window, constants and padding as in 3-D Gaussian splatting code.
    """
    rendered = check_image("rendered", rendered, target.mask)
    if rendered.shape != target.image.shape:
        raise ValueError(f"rendered has shape {rendered.shape}; expected {target.image.shape}")
    channels, height, width = rendered.shape
    padded = (channels, height + 2 * RADIUS, width + 2 * RADIUS)
    difference, total = np.empty(padded, rendered.dtype), np.empty(padded, rendered.dtype)
    slopes = np.empty((3, *padded), rendered.dtype)
    saved = SsimSaved(difference, total, slopes, target)
    if target.count == 0:
        return 1.0, saved
    image = target.image.astype(rendered.dtype, copy=False)
    totals = np.empty(channels * height)
    for array in (difference, total, slopes):
        _clear_border(array)
    parallel_for(_difference_and_sum_kernel, totals.size, rendered, image, target.mask, difference, total)
    parallel_for(
        _similarity_kernel, totals.size, difference, total, target.mask, window(rendered.dtype), slopes, totals
    )
    return 1.0 - float(totals.sum()) / target.count, saved


def masked_ssim_reverse(d_ssim: float, saved: SsimSaved) -> FloatArray:
    """d_rendered (C, H, W) for the derivative d_ssim of a loss with respect to the mean SSIM; 0 outside the mask."""
    target = saved.target
    if target.count == 0:
        return np.zeros(target.image.shape, saved.difference.dtype)
    d_rendered = np.empty(target.image.shape, saved.difference.dtype)
    scale = d_rendered.dtype.type(float(d_ssim) / target.count)
    rows = target.image.shape[0] * target.image.shape[1]
    parallel_for(_similarity_reverse_kernel, rows, *saved[:3], target.mask, window(d_rendered.dtype), scale, d_rendered)
    return d_rendered


def window(dtype: np.dtype) -> FloatArray:
    """The Gaussian window along one axis, (11,), normalised to sum 1 in float64 and then rounded."""
    offset = np.arange(-RADIUS, RADIUS + 1)
    weights = np.exp(-(offset**2) / (2 * WINDOW_SIGMA**2))
    return (weights / weights.sum()).astype(dtype)


def _unit_image(first, stop, levels, largest, mask, image):
    """levels / largest on tissue, 0 elsewhere."""
    height, width = mask.shape
    real = image.dtype.type
    for index in range(first, stop):
        channel, y = index // height, index % height
        source, tissue, target = levels[channel, y], mask[y], image[channel, y]
        for i in range(width):
            value = real(source[i]) / largest
            target[i] = value if tissue[i] else real(0)


def _clear_border(padded: FloatArray) -> None:
    """Set the padding of the last two axes to 0."""
    for border in (slice(None, RADIUS), slice(-RADIUS, None)):
        padded[..., border, :] = 0
        padded[..., border] = 0


def _difference_and_sum(first, stop, rendered, image, mask, difference, total):
    """e and s on tissue, 0 elsewhere."""
    height, width = mask.shape
    zero = rendered.dtype.type(0)
    for index in range(first, stop):
        channel, y = index // height, index % height
        seen, wanted, tissue = rendered[channel, y], image[channel, y], mask[y]
        e, s = difference[channel, y + RADIUS, RADIUS:], total[channel, y + RADIUS, RADIUS:]
        for i in range(width):
            e[i] = seen[i] - wanted[i] if tissue[i] else zero
            s[i] = seen[i] + wanted[i] if tissue[i] else zero


def _column_moments(rows, weights, mean, variance):
    """Mean and variance down each column of `rows` (11, width), about the central row's value."""
    zero = rows.dtype.type(0)
    for i in range(mean.size):
        centre = rows[RADIUS, i]
        first, second = zero, zero
        for k in range(TAPS):
            deviation = rows[k, i] - centre
            weighted = weights[k] * deviation
            first += weighted
            second += weighted * deviation
        mean[i] = centre + first
        variance[i] = second - first * first


def _row_moments(column_mean, column_variance, weights, mean, variance):
    """Mean and variance of the whole window from the means and variances of its 11 columns."""
    zero = column_mean.dtype.type(0)
    for i in range(mean.size):
        centre = column_mean[i + RADIUS]
        first, second = zero, zero
        for k in range(TAPS):
            deviation = column_mean[i + k] - centre
            first += weights[k] * deviation
            second += weights[k] * (column_variance[i + k] + deviation * deviation)
        mean[i] = centre + first
        variance[i] = second - first * first


def _similarity(first, stop, difference, total, mask, weights, slopes, totals):
    """1 - SSIM summed along each row, and the three slope maps of the reverse pass.

    d sum_p SSIM_p / dx_q = sum_p w(p - q) [a + 2 b (e_q - mu_e) + 2 c (s_q - mu_s)] with, all at tissue pixel p,
    a = dSSIM/dmu_e + dSSIM/dmu_s, b = dSSIM/dsigma_e^2, c = dSSIM/dsigma_s^2. The slopes are the factors
    of 1, 2 e_q and 2 s_q.
    """
    height, width = mask.shape
    real = difference.dtype.type
    zero, half, one, two = real(0), real(0.5), real(1), real(2)
    c1, c2 = real(C1), real(C2)
    columns = np.empty((4, width + 2 * RADIUS), difference.dtype)
    lines = np.empty((5, width), difference.dtype)
    mean_e, variance_e, mean_s, variance_s, dissimilarity = lines[0], lines[1], lines[2], lines[3], lines[4]
    for index in range(first, stop):
        channel, y = index // height, index % height
        _column_moments(difference[channel, y : y + TAPS], weights, columns[0], columns[1])
        _column_moments(total[channel, y : y + TAPS], weights, columns[2], columns[3])
        _row_moments(columns[0], columns[1], weights, mean_e, variance_e)
        _row_moments(columns[2], columns[3], weights, mean_s, variance_s)
        tissue = mask[y]
        slope_1 = slopes[0, channel, y + RADIUS, RADIUS:]
        slope_e = slopes[1, channel, y + RADIUS, RADIUS:]
        slope_s = slopes[2, channel, y + RADIUS, RADIUS:]
        for i in range(width):
            b1 = (mean_s[i] * mean_s[i] + mean_e[i] * mean_e[i]) * half + c1
            b2 = (variance_s[i] + variance_e[i]) * half + c2
            p_loss = mean_e[i] * mean_e[i] / b1  # 1 - P
            q_loss = variance_e[i] / b2  # 1 - Q
            p, q = one - p_loss, one - q_loss
            a = q * (p_loss * mean_s[i] - (one + p) * mean_e[i]) / b1
            b = -p * (one + q) / (two * b2)
            c = p * q_loss / (two * b2)
            dissimilarity[i] = p_loss + p * q_loss if tissue[i] else zero
            slope_1[i] = a - two * (b * mean_e[i] + c * mean_s[i]) if tissue[i] else zero
            slope_e[i] = b if tissue[i] else zero
            slope_s[i] = c if tissue[i] else zero
        totals[index] = row_total(dissimilarity)


def _similarity_reverse(first, stop, difference, total, slopes, mask, weights, scale, d_rendered):
    """Three smoothed maps, combined at each tissue pixel; the window is symmetric and so its own adjoint."""
    height, width = mask.shape
    two, zero = d_rendered.dtype.type(2), d_rendered.dtype.type(0)
    columns = np.empty(width + 2 * RADIUS, d_rendered.dtype)
    smooth = np.empty((3, width), d_rendered.dtype)
    alone, with_e, with_s = smooth[0], smooth[1], smooth[2]
    for index in range(first, stop):
        channel, y = index // height, index % height
        for k in range(3):
            _smooth_columns(slopes[k, channel, y : y + TAPS], weights, columns)
            _smooth_row(columns, weights, smooth[k])
        e, s = difference[channel, y + RADIUS, RADIUS:], total[channel, y + RADIUS, RADIUS:]
        out, tissue = d_rendered[channel, y], mask[y]
        for i in range(width):
            slope = scale * (alone[i] + two * (e[i] * with_e[i] + s[i] * with_s[i]))
            out[i] = slope if tissue[i] else zero


def _smooth_columns(rows, weights, out):
    for i in range(out.size):
        value = rows.dtype.type(0)
        for k in range(TAPS):
            value += weights[k] * rows[k, i]
        out[i] = value


def _smooth_row(line, weights, out):
    for i in range(out.size):
        value = line.dtype.type(0)
        for k in range(TAPS):
            value += weights[k] * line[i + k]
        out[i] = value


_column_moments, _row_moments = jit(_column_moments), jit(_row_moments)
_smooth_columns, _smooth_row = jit(_smooth_columns), jit(_smooth_row)
_unit_image_kernel = jit(_unit_image)
_difference_and_sum_kernel = jit(_difference_and_sum)
_similarity_kernel = jit(_similarity)
_similarity_reverse_kernel = jit(_similarity_reverse)
