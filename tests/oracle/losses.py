"""Oracles of the base losses (B6)-(B9): the formulas with loops over pixels, plain NumPy, float64 or wider."""

import numpy as np

C1, C2 = 0.01**2, 0.03**2


def masked_l1(rendered, observed, mask):
    """(B6)"""
    values = [
        abs(rendered[c, y, x] - observed[c, y, x]) for c in range(len(rendered)) for y, x in zip(*np.nonzero(mask))
    ]
    return sum(values) / len(values) if values else 0.0


def gaussian_window():
    """11 x 11 weights of sum 1."""
    offset = np.arange(-5, 6)
    weights = np.exp(-(offset[:, None] ** 2 + offset[None, :] ** 2) / (2 * 1.5**2))
    return weights / weights.sum()


def ssim_at(x, y, window):
    """SSIM of two 11 x 11 patches, the textbook form with variances about the mean."""
    mean_x, mean_y = (window * x).sum(), (window * y).sum()
    variance_x, variance_y = (window * (x - mean_x) ** 2).sum(), (window * (y - mean_y) ** 2).sum()
    covariance = (window * (x - mean_x) * (y - mean_y)).sum()
    above = (2 * mean_x * mean_y + C1) * (2 * covariance + C2)
    return above / ((mean_x**2 + mean_y**2 + C1) * (variance_x + variance_y + C2))


def ssim_map(x, y):
    """SSIM at every pixel of planar images (C, H, W), surrounded by zeros."""
    window = gaussian_window()
    wide = [np.pad(image, ((0, 0), (5, 5), (5, 5))) for image in (x, y)]
    out = np.empty(x.shape, np.result_type(x, y))
    for c, row, column in np.ndindex(x.shape):
        patches = [image[c, row : row + 11, column : column + 11] for image in wide]
        out[c, row, column] = ssim_at(*patches, window)
    return out


def masked_ssim(rendered, observed, mask):
    """(B7)"""
    if not mask.any():
        return 1.0
    zeroed = [np.where(mask, image, 0) for image in (rendered, observed)]
    return ssim_map(*zeroed)[:, mask].mean()


def masked_ssim_gradient(rendered, observed, mask, step=1e-40):
    """Derivative of (B7) by every entry of the render, by complex steps; only windows that hold the entry change."""
    window, count = gaussian_window(), rendered.shape[0] * mask.sum()
    x, y = (np.pad(np.where(mask, a, 0), ((0, 0), (5, 5), (5, 5))).astype(complex) for a in (rendered, observed))
    gradient = np.zeros(rendered.shape)
    height, width = mask.shape
    for c, row, column in np.ndindex(rendered.shape):
        if not mask[row, column]:
            continue
        x[c, row + 5, column + 5] += 1j * step
        for r in range(max(0, row - 5), min(height, row + 6)):
            for k in range(max(0, column - 5), min(width, column + 6)):
                if mask[r, k]:
                    value = ssim_at(x[c, r : r + 11, k : k + 11], y[c, r : r + 11, k : k + 11], window)
                    gradient[c, row, column] += value.imag / step / count
        x[c, row + 5, column + 5] -= 1j * step
    return gradient


def normalised_depth(rendered, prior, mask):
    """(B8): the loss and its derivative by the rendered depth."""
    gradient = np.zeros(rendered.shape)
    pixels = [(y, x) for y, x in zip(*np.nonzero(mask)) if np.isfinite(prior[y, x]) and prior[y, x] > 0]
    largest = max((v for v in rendered.flat if np.isfinite(v)), default=0)
    if len(pixels) < 10 or largest <= 0:
        return 0.0, gradient
    largest_prior = max(v for v in prior.flat if np.isfinite(v) and v > 0)
    loss, d_largest = 0.0, 0.0
    for p in pixels:
        residual = rendered[p] / largest - prior[p] / largest_prior
        loss += abs(residual) / len(pixels)
        gradient[p] += np.sign(residual) / (len(pixels) * largest)
        d_largest -= np.sign(residual) * rendered[p] / (len(pixels) * largest**2)
    holders = [p for p in np.ndindex(rendered.shape) if rendered[p] == largest]
    for p in holders:
        gradient[p] += d_largest / len(holders)
    return loss, gradient


def _neighbours(height, width):
    """Index pairs of horizontal and vertical neighbours."""
    for y in range(height):
        for x in range(width):
            if x + 1 < width:
                yield (y, x), (y, x + 1)
            if y + 1 < height:
                yield (y, x), (y + 1, x)


def total_variation(image, mask):
    """TV((1 - M) image) and its derivative, image (C, H, W)."""
    gradient, total = np.zeros(image.shape), 0.0
    for c in range(len(image)):
        plane = np.where(mask, 0, image[c])
        for a, b in _neighbours(*mask.shape):
            total += abs(plane[b] - plane[a])
            for p, sign in ((b, 1), (a, -1)):
                if not mask[p]:
                    gradient[c][p] += sign * np.sign(plane[b] - plane[a])
    return total / image.size, gradient / image.size


def smoothness(depth, rendered, mask, edges, factor):
    """(B9): the loss and its derivatives by depth and image."""
    smooth = mask & ~edges
    weight = 1 / (smooth.sum() + 1e-6)
    total, d_depth = 0.0, np.zeros(depth.shape)
    for a, b in _neighbours(*mask.shape):
        if smooth[a] and smooth[b]:
            total += (depth[a] - depth[b]) ** 2 * weight
            d_depth[a] += 2 * (depth[a] - depth[b]) * weight
            d_depth[b] -= 2 * (depth[a] - depth[b]) * weight
    of_depth, d_of_depth = total_variation(depth[None], mask)
    of_image, d_of_image = total_variation(rendered, mask)
    return total + factor * (of_depth + of_image), d_depth + factor * d_of_depth[0], factor * d_of_image
