"""Equation (5): the mask-propagating Laplacian loss of component L.

In: the rendered image, not clamped, and the observed one in [0, 1], planar (3, H, W); the tissue mask (H, W), True =
tissue. Out: a scalar in display units, and its derivative with respect to the rendered image.

    G_0 = image, G_j = reduce(G_{j-1}), P_j = G_{j-1} - expand(G_j), j = 1 ... 3
    L_lap = (1/3) sum_j mean over the valid band pixels and the channels of |P_j(rendered) - P_j(observed)|

A band pixel is valid when every input pixel of its footprint is tissue. The pyramid is linear, so one pyramid of the
difference image, set to 0 outside tissue, gives all valid band differences up to rounding. Values under the instrument
(NaN included) reach none of them, and equal images have loss and gradient exactly 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations.pyramid import (
    ROWS,
    Upsampling,
    coarse_length,
    expand_adjoint_table,
    expand_image,
    expand_parents,
    expand_row,
    expand_row_adjoint,
    expand_weights,
    gather_rows,
    reduce_adjoint_table,
    reduce_image,
    reduce_row_adjoint,
    reflect_indices,
)
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

LEVELS = 3


class LaplacianLevels(NamedTuple):
    """A Laplacian pyramid: bands[0] + expand(bands[1] + expand(...)) is the image."""

    bands: tuple[FloatArray, ...]  # P_1 ... P_levels, fine to coarse; P_j has the size of G_{j-1}
    coarse: FloatArray  # G_levels


class SupportMasks(NamedTuple):
    """Valid band pixels; they depend on the frame only and are cached."""

    image: BoolArray  # (H, W)  the tissue mask
    bands: tuple[BoolArray, ...]  # valid pixels of P_1 ... P_levels
    upsampling: Upsampling

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of valid pixels of every band; an empty level (0) adds 0 to the loss."""
        return tuple(int(np.count_nonzero(band)) for band in self.bands)


class LaplacianSaved(NamedTuple):
    """Signs of the valid band differences, and their weights."""

    signs: tuple[NDArray[np.int8], ...]  # (3, h, w) per level: -1, 0, 1; 0 where invalid
    weights: tuple[float, ...]  # 1 / (levels * channels * valid pixels), 0 for an empty level
    mask: BoolArray  # (H, W)
    upsampling: Upsampling
    dtype: np.dtype


def laplacian_levels(image: FloatArray, levels: int = LEVELS, upsampling: Upsampling = "co_sited") -> LaplacianLevels:
    """The Laplacian pyramid of an image, without a mask.

    image       (C, H, W)  any unit; any H, W >= 1
    levels      number of bands
    upsampling  `co_sited` (a unit ramp has bands 0) or `half_pixel` (0.5, 1, 2)
    returns     the bands and the coarsest image, dtype of the image
    Edges:      the next size is ceil(n/2); a 1x1 image has bands 0.
    Oracle:     `endotsr.definition.laplacian`; scipy.ndimage.correlate1d(mode="mirror") for the filter.
    """
    bands = []
    for _ in range(levels):
        coarse = reduce_image(image)
        bands.append(image - expand_image(coarse, (image.shape[1], image.shape[2]), upsampling))
        image = coarse
    return LaplacianLevels(tuple(bands), image)


def _reduce_support(valid: BoolArray) -> BoolArray:
    """A coarse sample is valid when its 5x5 fine samples are: erosion, then decimation."""
    for axis in (0, 1):
        taps = reflect_indices(valid.shape[axis])
        valid = np.logical_and.reduce([valid.take(tap, axis=axis) for tap in taps])
    return valid


def _expand_support(valid: BoolArray, shape: tuple[int, ...], upsampling: Upsampling) -> BoolArray:
    """A fine sample is valid when all coarse samples of its interpolation are."""
    for axis in (0, 1):
        parents = [[p for p, _ in expand_parents(i, shape[axis], upsampling)] for i in range(shape[axis])]
        first, last = [p[0] for p in parents], [p[-1] for p in parents]
        valid = valid.take(first, axis=axis) & valid.take(last, axis=axis)
    return valid


def _full_bands(shape: tuple[int, ...], levels: int) -> tuple[BoolArray, ...]:
    """Bands without an invalid pixel."""
    bands = []
    for _ in range(levels):
        bands.append(np.ones(shape, np.bool_))
        shape = tuple(coarse_length(side) for side in shape)
    return tuple(bands)


def support_masks(mask: BoolArray, levels: int = LEVELS, upsampling: Upsampling = "co_sited") -> SupportMasks:
    """Valid pixels of every band: the boolean mask propagated through the operations of the pyramid.

    mask     (H, W)  True = tissue
    returns  a mask of the size of each band. A band pixel is valid when every image pixel in its footprint is
             tissue: 5-7, 13-17, 29-37 pixels per axis for `co_sited`, 7, 17, 37 for `half_pixel`
    Edges:   a level may be empty. Raises ValueError for an unknown `upsampling`.
    Oracle:  `endotsr.definition.laplacian`; impulse responses of the pyramid, tests/oracle/laplacian_oracle.py.
    """
    expand_weights(upsampling)  # rejects an unknown name even if nothing is propagated
    mask = np.ascontiguousarray(mask, dtype=np.bool_)
    bands, valid = [], mask
    if mask.all():  # nothing to propagate: every band pixel is valid
        return SupportMasks(mask, _full_bands(mask.shape, levels), upsampling)
    for _ in range(levels):
        coarse = _reduce_support(valid)
        bands.append(np.ascontiguousarray(valid & _expand_support(coarse, valid.shape, upsampling)))
        valid = coarse
    return SupportMasks(mask, tuple(bands), upsampling)


def _difference(first, stop, rendered, observed, mask, out):
    h, w = mask.shape
    real = rendered.dtype.type
    for index in range(first, stop):
        c, y = index // h, index % h
        a, b, keep, target = rendered[c, y], observed[c, y], mask[y], out[c, y]
        for x in range(w):
            d = a[x] - b[x]
            target[x] = d if keep[x] else real(0.0)


def _band_signs(first, stop, fine, coarse, even, odd, valid, signs, sums):
    """signs = sign of fine - expand(coarse) where valid; sums[task] = sum of its magnitude over ROWS rows."""
    h, w = valid.shape
    m = coarse.shape[2]
    real = fine.dtype.type
    chunks = (h + ROWS - 1) // ROWS
    blend = np.empty(m + 2, fine.dtype)
    pairs = np.empty((m, 2), fine.dtype)
    smooth = pairs.reshape(-1)
    columns = np.empty(w)  # float64: one partial sum per column
    for task in range(first, stop):
        c, top = task // chunks, (task % chunks) * ROWS
        for x in range(w):
            columns[x] = 0.0
        for y in range(top, min(h, top + ROWS)):
            expand_row(coarse[c], y, even, odd, blend, pairs)
            row, keep, sign = fine[c, y], valid[y], signs[c, y]
            for x in range(w):
                band = row[x] - smooth[x]
                band = band if keep[x] else real(0.0)
                columns[x] += np.float64(abs(band))
                sign[x] = np.int8(band > real(0.0)) - np.int8(band < real(0.0))
        total = 0.0
        for x in range(w):
            total += columns[x]
        sums[task] = total


def _expand_adjoint(first, stop, field, scale, starts, index, weight, even, odd, out):
    """out = scale * expand^T(field)"""
    mh, m = out.shape[1:]
    pairs = np.zeros((m + 2, 2), out.dtype)
    inside = pairs.reshape(-1)[2 : 2 + field.shape[2]]
    for task in range(first, stop):
        c, y = task // mh, task % mh
        gather_rows(field[c], starts, index, weight, y, inside)
        target = out[c, y]
        expand_row_adjoint(pairs, even, odd, target)
        for x in range(m):
            target[x] *= scale


def _reduce_adjoint(first, stop, d_coarse, starts, index, weight, field, scale, keep_out, gate, out):
    """out = (out if keep_out else 0) + (scale * field + reduce^T(d_coarse)) where gate is True, 0 elsewhere."""
    h, w = gate.shape
    m = d_coarse.shape[2]
    real = out.dtype.type
    gathered = np.zeros(m + 4, out.dtype)
    middle = gathered[2 : 2 + m]
    pairs = np.empty((m + 2, 2), out.dtype)
    pulled = pairs.reshape(-1)[2:]
    for task in range(first, stop):
        c, y = task // h, task % h
        gather_rows(d_coarse[c], starts, index, weight, y, middle)
        reduce_row_adjoint(gathered, pairs, w)
        source, allowed, target = field[c, y], gate[y], out[c, y]
        if not keep_out:
            for x in range(w):
                target[x] = real(0.0)
        for x in range(w):
            d = target[x] + (scale * real(source[x]) + pulled[x])
            target[x] = d if allowed[x] else real(0.0)


_difference_kernel = jit(_difference)
_band_signs_kernel = jit(_band_signs)
_expand_adjoint_kernel = jit(_expand_adjoint)
_reduce_adjoint_kernel = jit(_reduce_adjoint)


def laplacian_loss_forward(
    rendered: FloatArray, observed: FloatArray, masks: SupportMasks, upsampling: Upsampling = "co_sited"
) -> tuple[float, LaplacianSaved]:
    """Equation (5): mean magnitude of the valid band differences, averaged over the levels.

    rendered    (3, H, W)  unclamped render, display units
    observed    (3, H, W)  observed image, display units
    masks       support_masks(mask, levels, upsampling) of this frame, cached by the caller
    upsampling  the rule of the masks
    returns     the loss, display units, summed in float64; and the saved tuple
    Reverse:    laplacian_loss_reverse, below.
    Edges:      an empty level adds 0 and the factor 1/levels stays. Pixels outside the mask may have any value. Equal
                images have loss 0 and gradient exactly 0 (subgradient of |.| at 0 is 0).
    Raises:     ValueError if the shapes disagree or the masks have another rule.
    Oracle:     `endotsr.definition.laplacian`, the difference of two separate pyramids.
    """
    if rendered.shape != observed.shape or rendered.shape[1:] != masks.image.shape:
        raise ValueError(f"rendered {rendered.shape}, observed {observed.shape}, mask {masks.image.shape} disagree")
    if masks.upsampling != upsampling:
        raise ValueError(f"upsampling: {upsampling!r}, but {masks.upsampling!r} in the masks")
    dtype = rendered.dtype
    channels = rendered.shape[0]
    even, odd = (dtype.type(weight) for weight in expand_weights(upsampling))
    fine = np.empty_like(rendered, order="C")
    observed = np.ascontiguousarray(observed, dtype)
    rows = channels * rendered.shape[1]
    parallel_for(_difference_kernel, rows, np.ascontiguousarray(rendered), observed, masks.image, fine)
    loss, signs, weights = 0.0, [], []
    for valid, count in zip(masks.bands, masks.counts):
        coarse = reduce_image(fine)
        sign = np.empty(fine.shape, np.int8)
        sums = np.empty(channels * ((fine.shape[1] + ROWS - 1) // ROWS))
        parallel_for(_band_signs_kernel, sums.size, fine, coarse, even, odd, valid, sign, sums)
        weight = 1.0 / (len(masks.bands) * channels * count) if count else 0.0
        loss += weight * float(sums.sum())
        signs.append(sign)
        weights.append(weight)
        fine = coarse
    return loss, LaplacianSaved(tuple(signs), tuple(weights), masks.image, upsampling, dtype)


def laplacian_loss_reverse(d_loss: float, saved: LaplacianSaved) -> FloatArray:
    """Reverse of equation (5): the adjoint of the pyramid applied to the weighted signs.

    d_loss   ()         derivative of the objective with respect to the loss
    returns  (3, H, W)  derivative with respect to the rendered image, dtype of the render; exactly 0 outside the mask
    """
    scales = tuple(float(d_loss) * weight for weight in saved.weights)
    return pull_back(saved.signs, scales, saved.mask, saved.upsampling, saved.dtype)


def pull_back(
    fields: tuple[NDArray, ...], scales: tuple[float, ...], mask: BoolArray, upsampling: Upsampling, dtype: np.dtype
) -> FloatArray:
    """Adjoint of masked image -> bands: sum_j scales[j] (d P_j / d image)^T fields[j], 0 outside the mask.

    From coarse to fine, with g_j the gradient of G_j and s_j = scales[j] fields[j] the gradient of P_j:
        g_3 = -expand^T s_3,   g_{j-1} = -expand^T s_{j-1} + s_j + reduce^T g_j,   and no first term for g_0.
    """
    real = np.dtype(dtype).type
    even, odd = (real(weight) for weight in expand_weights(upsampling))

    def expanded_part(level: int) -> FloatArray:
        channels, h, w = fields[level].shape
        out = np.empty((channels, coarse_length(h), coarse_length(w)), dtype)
        table = expand_adjoint_table(h, upsampling)
        rows = channels * out.shape[1]
        parallel_for(_expand_adjoint_kernel, rows, fields[level], real(-scales[level]), *table, even, odd, out)
        return out

    last = len(fields) - 1
    d_coarse = expanded_part(last)
    for level in range(last, -1, -1):
        field = fields[level]
        inner = level > 0
        out = expanded_part(level - 1) if inner else np.empty(field.shape, dtype)
        gate = np.ones(field.shape[1:], np.bool_) if inner else mask
        table = reduce_adjoint_table(field.shape[1])
        rows, scale = field.shape[0] * field.shape[1], real(scales[level])
        parallel_for(_reduce_adjoint_kernel, rows, d_coarse, *table, field, scale, inner, gate, out)
        d_coarse = out
    return d_coarse
