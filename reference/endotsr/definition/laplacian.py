"""Equation (5): the mask-propagating Laplacian loss of component L, by dense matrices."""

from collections import namedtuple

import numpy as np

# bands[0] + expand(bands[1] + expand(...)) is the image.
LaplacianLevels = namedtuple("LaplacianLevels", "bands coarse")
SupportMasks = namedtuple("SupportMasks", "image bands upsampling")  # Valid values of every band.
# Derivative of the loss with respect to every band, and the constants of the adjoint.
LaplacianSaved = namedtuple("LaplacianSaved", "slopes masks")


def reduce_matrix(n):
    """D along one axis, (ceil(n/2), n): five binomial taps at the even samples, mirrored at the border."""
    matrix = np.zeros(((n + 1) // 2, n))
    for row in range(len(matrix)):
        for tap, weight in zip(range(2 * row - 2, 2 * row + 3), (1, 4, 6, 4, 1)):
            k = tap % max(2 * (n - 1), 1)
            matrix[row, k if k < n else 2 * (n - 1) - k] += weight / 16
    return matrix


def expand_matrix(n, upsampling):
    """U along one axis, (n, ceil(n/2)): linear interpolation, constant beyond the end samples."""
    coarse = np.arange((n + 1) // 2)
    at = np.arange(n) / 2 if upsampling == "co_sited" else (np.arange(n) + 0.5) / 2 - 0.5
    return np.stack([np.interp(at, coarse, unit) for unit in np.eye(coarse.size)], axis=1)


def matrices(shape, upsampling):
    """D and U of the rows, D and U of the columns, of an image (H, W). The kernels never form them."""
    return [matrix for n in shape for matrix in (reduce_matrix(n), expand_matrix(n, upsampling))]


def laplacian_levels(image, levels=3, upsampling="co_sited"):
    """G_j = D G_{j-1}, P_j = G_{j-1} - U G_j of an image (C, H, W)."""
    bands = []
    for _ in range(levels):
        d_rows, u_rows, d_columns, u_columns = matrices(image.shape[1:], upsampling)
        coarse = d_rows @ image @ d_columns.T
        bands.append(image - u_rows @ coarse @ u_columns.T)
        image = coarse
    return LaplacianLevels(tuple(bands), image)


def support_masks(mask, levels=3, upsampling="co_sited"):
    """V_j: values to which no excluded pixel of `mask` (H, W) contributes. S_0 = mask is propagated through D and U."""
    bands = []
    valid = mask
    for _ in range(levels):
        d_rows, u_rows, d_columns, u_columns = (matrix != 0 for matrix in matrices(valid.shape, upsampling))
        coarse = ~(d_rows @ ~valid @ d_columns.T)
        bands.append(valid & ~(u_rows @ ~coarse @ u_columns.T))
        valid = coarse
    return SupportMasks(mask, tuple(bands), upsampling)


def laplacian_loss_forward(rendered, observed, masks, upsampling="co_sited"):
    """Equation (5): display units, from two pyramids. The kernel builds one pyramid of the difference.

    `upsampling` is the rule of the masks, by which the reverse pass goes.
    """
    images = [np.where(masks.image, image, 0) for image in (rendered, observed)]
    one, other = (laplacian_levels(image, len(masks.bands), upsampling).bands for image in images)
    loss, slopes = 0.0, []
    for p, q, valid in zip(one, other, masks.bands):
        weight = valid / max(len(p) * valid.sum(), 1) / len(masks.bands)
        loss += (weight * np.abs(p - q)).sum()
        slopes.append(weight * np.sign(p - q))  # (10.1)
    return loss, LaplacianSaved(tuple(slopes), masks)


def laplacian_loss_reverse(d_loss, saved):
    """Reverse of (5): d_rendered (3, H, W); g_{G_{j-1}} = g_{P_j} + D^T (g_{G_j} - U^T g_{P_j}), coarse to fine."""
    d_coarse = 0.0
    for slope in reversed(saved.slopes):  # (10.5)
        d_rows, u_rows, d_columns, u_columns = matrices(slope.shape[1:], saved.masks.upsampling)
        d_coarse = d_coarse - u_rows.T @ slope @ u_columns  # (10.2), (10.3)
        d_coarse = slope + d_rows.T @ d_coarse @ d_columns  # (10.3), (10.4)
    return d_loss * np.where(saved.masks.image, d_coarse, 0)  # (10.6)
