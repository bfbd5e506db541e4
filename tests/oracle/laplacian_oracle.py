"""Equation (5) with dense matrices: the filter from scipy, the interpolation from numpy, two pyramids taken apart."""

import numpy as np
from scipy.ndimage import correlate1d


def reduce_matrix(n):
    """(ceil(n/2), n): 5-tap binomial with mirrored border, even samples."""
    return correlate1d(np.eye(n), np.array([1, 4, 6, 4, 1]) / 16, axis=0, mode="mirror")[::2]


def expand_matrix(n, rule):
    """(n, ceil(n/2)): linear interpolation, constant beyond the end samples."""
    m = (n + 1) // 2
    fine = np.arange(n) / 2 if rule == "co_sited" else (np.arange(n) + 0.5) / 2 - 0.5
    return np.stack([np.interp(fine, np.arange(m), row) for row in np.eye(m)], axis=1)


def both_axes(matrix_of, image, *arguments):
    rows = matrix_of(arguments[0][0], *arguments[1:])
    columns = matrix_of(arguments[0][1], *arguments[1:])
    return np.einsum("yh,chw,xw->cyx", rows, image, columns, optimize=True)


def pyramid(image, rule, levels=3):
    """bands, coarsest image"""
    bands = []
    for _ in range(levels):
        shape = image.shape[1:]
        coarse = both_axes(reduce_matrix, image, shape)
        bands.append(image - both_axes(expand_matrix, coarse, shape, rule))
        image = coarse
    return bands, image


def _valid(matrix_rows, matrix_columns, mask):
    """Samples all of whose contributors are tissue, from the nonzero pattern of a separable map."""
    bad = (matrix_rows != 0).astype(int) @ (~mask).astype(int) @ (matrix_columns != 0).astype(int).T
    return bad == 0


def masks_by_impulse_response(mask, rule, levels=3):
    """Valid band pixels from the impulse responses of G_{j-1} and expand(G_j) as maps of the input image."""
    to_rows, to_columns = np.eye(mask.shape[0]), np.eye(mask.shape[1])
    found = []
    for _ in range(levels):
        h, w = to_rows.shape[0], to_columns.shape[0]
        next_rows, next_columns = reduce_matrix(h) @ to_rows, reduce_matrix(w) @ to_columns
        smooth_rows, smooth_columns = expand_matrix(h, rule) @ next_rows, expand_matrix(w, rule) @ next_columns
        found.append(_valid(to_rows, to_columns, mask) & _valid(smooth_rows, smooth_columns, mask))
        to_rows, to_columns = next_rows, next_columns
    return found


def masks_by_float(mask, rule, levels=3):
    """A mask of ones sent through the dyadic weights: valid where it is still exactly 1."""
    image = mask[None].astype(float)
    found = []
    for _ in range(levels):
        coarse = both_axes(reduce_matrix, image, image.shape[1:])
        smooth = both_axes(expand_matrix, coarse, image.shape[1:], rule)
        found.append(((image == 1.0) & (smooth == 1.0))[0])
        image = coarse
    return found


def footprint_lengths(n, rule, levels=3):
    """For every level the set of footprint lengths, in pixels, of band samples far from the ends of a line."""
    to = np.eye(n)
    found = []
    for _ in range(levels):
        following = reduce_matrix(to.shape[0]) @ to
        union = (to != 0) | (expand_matrix(to.shape[0], rule) @ following != 0)
        inner = slice(to.shape[0] // 3, 2 * to.shape[0] // 3)
        found.append({int(count) for count in union[inner].sum(axis=1)})
        to = following
    return found


def loss(rendered, observed, masks, rule):
    with np.errstate(invalid="ignore"):
        a, _ = pyramid(rendered, rule, len(masks))
        b, _ = pyramid(observed, rule, len(masks))
    total = 0.0
    for p, q, valid in zip(a, b, masks):
        if valid.any():
            total += np.abs(p - q)[:, valid].mean()
    return total / len(masks)


def loss_gradient(rendered, observed, masks, rule):
    gradient = np.zeros_like(rendered)
    difference = rendered - observed
    bands, _ = pyramid(difference, rule, len(masks))
    channels, h, w = rendered.shape
    to_rows, to_columns = np.eye(h), np.eye(w)
    for band, valid in zip(bands, masks):
        lh, lw = valid.shape
        sign = np.sign(band) * valid / max(1, channels * valid.sum()) / len(masks)
        next_rows, next_columns = reduce_matrix(lh) @ to_rows, reduce_matrix(lw) @ to_columns
        smooth_rows = expand_matrix(lh, rule) @ next_rows
        smooth_columns = expand_matrix(lw, rule) @ next_columns
        gradient += to_rows.T @ sign @ to_columns - smooth_rows.T @ sign @ smooth_columns
        to_rows, to_columns = next_rows, next_columns
    return gradient
