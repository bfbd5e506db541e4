"""The supports of the pyramid (5) in two other ways, by impulse responses and by a mask of numbers; filter of scipy."""

import numpy as np
from scipy.ndimage import correlate1d


def reduce_matrix(n):
    """(ceil(n/2), n): 5-tap binomial with mirrored border, even samples."""
    return correlate1d(np.eye(n), np.array([1, 4, 6, 4, 1]) / 16, axis=0, mode="mirror")[::2]


def expand_matrix(n, rule):
    """(n, ceil(n/2)): the two weights of every fine sample, the end sample repeated beyond the ends."""
    m = (n + 1) // 2
    wide = np.pad(np.eye(m), ((1, 1), (0, 0)), mode="edge")  # row k + 1 is coarse sample k
    even, odd = (0.0, 0.5) if rule == "co_sited" else (0.25, 0.75)  # weight of the earlier coarse sample
    rows = [
        even * wide[k] + (1 - even) * wide[k + 1] if i % 2 == 0 else odd * wide[k + 1] + (1 - odd) * wide[k + 2]
        for i, k in ((i, i // 2) for i in range(n))
    ]
    return np.array(rows)


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
    image, found = mask.astype(float), []
    for _ in range(levels):
        h, w = image.shape
        coarse = reduce_matrix(h) @ image @ reduce_matrix(w).T
        found.append((image == 1.0) & (expand_matrix(h, rule) @ coarse @ expand_matrix(w, rule).T == 1.0))
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
