"""The losses of the port by hand: (5), (B6) to (B9), forward and reverse."""

import numpy as np

# ---- (B6) masked L1 ----


def masked_l1(i, s):
    mask = i["mask"]
    n = mask.sum()
    difference = np.where(mask, i["rendered"] - i["observed"], 0)
    if n == 0:
        return {"loss": 0.0, "d_rendered": 0 * difference}
    loss = np.abs(difference).sum() / (3 * n)
    return {"loss": loss, "d_rendered": i["d_loss"] * np.sign(difference) / (3 * n)}


# ---- (B7) masked SSIM ----

C1, C2 = 0.01**2, 0.03**2


def blurred(image):
    """The image under the window of 11 x 11, with zeros outside."""
    x = np.arange(-5, 6)
    window = np.exp(-(x**2) / (2 * 1.5**2))
    window = window / window.sum()
    height, width = image.shape[1:]
    wide = np.pad(image, ((0, 0), (5, 5), (0, 0)))
    rows = sum(window[j] * wide[:, j : j + height] for j in range(11))
    wide = np.pad(rows, ((0, 0), (0, 0), (5, 5)))
    return sum(window[j] * wide[:, :, j : j + width] for j in range(11))


def masked_ssim(i, s):
    mask = i["mask"]
    n = mask.sum()
    x = np.where(mask, i["rendered"], 0)
    y = np.where(mask, i["observed"], 0)
    if n == 0:
        return {"ssim": 1.0, "d_rendered": 0 * x}
    mu_x, mu_y = blurred(x), blurred(y)
    var_x = blurred(x * x) - mu_x**2
    var_y = blurred(y * y) - mu_y**2
    cov = blurred(x * y) - mu_x * mu_y
    a1, a2 = 2 * mu_x * mu_y + C1, 2 * cov + C2
    b1, b2 = mu_x**2 + mu_y**2 + C1, var_x + var_y + C2
    map_ = a1 * a2 / (b1 * b2)
    ssim = map_[:, mask].sum() / (3 * n)
    nu = np.where(mask, i["d_ssim"] / (3 * n), 0)
    by_mean = nu * (2 * mu_y * (a2 - a1) / (b1 * b2) - 2 * mu_x * map_ * (1 / b1 - 1 / b2))
    by_square = -nu * map_ / b2
    by_product = nu * 2 * a1 / (b1 * b2)
    d_x = blurred(by_mean) + 2 * x * blurred(by_square) + y * blurred(by_product)
    return {"ssim": ssim, "d_rendered": np.where(mask, d_x, 0)}


# ---- (B8) normalised depth ----


def normalised_depth(i, s):
    depth, prior = i["rendered_depth"], i["prior_depth"]
    zero = {"loss": 0.0, "d_rendered_depth": np.zeros(depth.shape)}
    usable = np.isfinite(prior) & (prior > 0)
    valid = i["mask"] & usable
    n = valid.sum()
    finite = np.isfinite(depth)
    if n < 10 or not finite.any():
        return zero
    highest = depth[finite].max()
    if highest <= 0:
        return zero
    highest_prior = prior[usable].max()
    d = np.where(valid, depth, 0)
    difference = np.where(valid, d / highest - np.where(valid, prior, 0) / highest_prior, 0)
    sign = np.sign(difference)
    holders = finite & (depth == highest)
    through = (sign * d).sum() / highest**2
    gradient = sign / highest - holders / holders.sum() * through
    return {"loss": np.abs(difference).sum() / n, "d_rendered_depth": i["d_loss"] / n * gradient}


# ---- (B9) smoothness ----


def pairs(shape):
    """Slices of the two pixels of every horizontal and of every vertical pair."""
    return (
        ((..., slice(None), slice(1, None)), (..., slice(None), slice(None, -1))),
        ((..., slice(1, None), slice(None)), (..., slice(None, -1), slice(None))),
    )


def squared_steps(depth, smooth):
    total, gradient = 0.0, np.zeros(depth.shape)
    for one, other in pairs(depth.shape):
        step = np.where(smooth[one] & smooth[other], depth[one] - depth[other], 0)
        total += (step**2).sum()
        gradient[one] += 2 * step
        gradient[other] -= 2 * step
    n = smooth.sum() + 1e-6
    return total / n, gradient / n


def total_variation(image, mask):
    outside = np.where(mask, 0, image)
    total, gradient = 0.0, np.zeros(image.shape)
    for one, other in pairs(image.shape):
        step = outside[one] - outside[other]
        total += np.abs(step).sum()
        gradient[one] += np.sign(step)
        gradient[other] -= np.sign(step)
    return total / image.size, np.where(mask, 0, gradient) / image.size


def smoothness(i, s):
    mask, factor = i["mask"], s["total_variation_factor"]
    smooth = mask & ~i["edges"]
    steps, d_steps = squared_steps(i["rendered_depth"], smooth)
    of_depth, d_of_depth = total_variation(i["rendered_depth"], mask)
    of_colour, d_of_colour = total_variation(i["rendered"], mask)
    g = i["d_loss"]
    return {
        "loss": steps + factor * of_depth + factor * of_colour,
        "d_rendered_depth": g * (d_steps + factor * d_of_depth),
        "d_rendered": g * factor * d_of_colour,
    }


# ---- (5) Laplacian ----


def reflected(k, n):
    if n == 1:
        return 0
    k = k % (2 * (n - 1))
    return k if k < n else 2 * (n - 1) - k


def reducing(n):
    """Matrix of the filter 1 4 6 4 1 at the even samples."""
    matrix = np.zeros(((n + 1) // 2, n))
    for row in range(len(matrix)):
        for offset, weight in zip((-2, -1, 0, 1, 2), (1, 4, 6, 4, 1), strict=True):
            matrix[row, reflected(2 * row + offset, n)] += weight / 16
    return matrix


def expanding(n, rule):
    coarse = (n + 1) // 2
    matrix = np.zeros((n, coarse))
    for row in range(n):
        k = row // 2
        after, before = min(k + 1, coarse - 1), max(k - 1, 0)
        if rule == "co_sited":
            matrix[row, k] += 0.5 if row % 2 else 1.0
            if row % 2:
                matrix[row, after] += 0.5
        else:
            matrix[row, k] += 0.75
            matrix[row, after if row % 2 else before] += 0.25
    return matrix


def laplacian(i, s):
    mask, rule = i["mask"], s["upsampling"]
    level = np.where(mask, i["rendered"] - i["observed"], 0)
    picture, support = i["observed"], mask
    out, loss, steps = {}, 0.0, []
    for j in (1, 2, 3):
        down = [reducing(n) for n in level.shape[1:]]
        up = [expanding(n, rule) for n in level.shape[1:]]
        coarse = down[0] @ level @ down[1].T
        band = level - up[0] @ coarse @ up[1].T
        coarse_picture = down[0] @ picture @ down[1].T
        out[f"band_{j}"] = picture - up[0] @ coarse_picture @ up[1].T
        full = ((down[0] != 0) @ (~support).astype(int) @ (down[1] != 0).T.astype(int)) == 0
        valid = support & (((up[0] != 0) @ (~full).astype(int) @ (up[1] != 0).T.astype(int)) == 0)
        n = valid.sum()
        if n:
            loss += np.abs(band[:, valid]).sum() / (3 * n)
        d_band = i["d_loss"] * np.where(valid, np.sign(band), 0) / (9 * max(n, 1))
        out[f"valid_{j}"] = valid
        steps.append((down, up, d_band))
        level, picture, support = coarse, coarse_picture, full
    d_level = np.zeros(level.shape)
    for down, up, d_band in steps[::-1]:
        d_coarse = d_level - up[0].T @ d_band @ up[1]
        d_level = d_band + down[0].T @ d_coarse @ down[1]
    return out | {"loss": loss / 3, "d_rendered": np.where(mask, d_level, 0)}
