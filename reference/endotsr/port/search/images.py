"""Decisions that another program may take for SSIM, the pyramid and the reading of a picture, each as a change.

Windows, borders and masks differ between libraries. `conventions.py` makes the changes.
"""

from endotsr.port.search.conventions import Convention

_BLURRED, _SSIM, _CONSTANTS = "masked_ssim.blurred", "masked_ssim.masked_ssim_forward", "masked_ssim.C1"
_KAPPA = "np.where(np.abs(offset) <= 5, np.exp(-(offset**2) / (2 * 1.5**2)), 0)"
_SUM = "np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2)).sum()"
_X, _Y = "np.where(target.mask, rendered, 0)", ("masked_ssim.ssim_target", "np.where(mask, observed, 0)")
_A2, _B2 = "2 * (blurred(x * y) - mu_x * mu_y) + C2", "blurred(x**2) - mu_x**2 + blurred(y**2) - mu_y**2 + C2"
_S, _MEAN = "s = a1 * a2 / (b1 * b2)", "np.where(target.mask, s, 0).sum() / target.count"
_WITHIN = "s[:, 5:-5, 5:-5]"
_REDUCE, _EXPAND = "laplacian.reduce_matrix", "laplacian.expand_matrix"
_TAPS, _FOLDED = "(1, 4, 6, 4, 1)", "k = tap % max(2 * (n - 1), 1)"
_ENTRY = "matrix[row, k if k < n else 2 * (n - 1) - k] += weight / 16"
_INTERPOLATED = "return np.stack([np.interp(at, coarse, unit) for unit in np.eye(coarse.size)], axis=1)"
_COARSE = ("laplacian.support_masks", "coarse = ~(d_rows @ ~valid @ d_columns.T)")
_KEYS = "registration.keys"
_LOSS = "laplacian.laplacian_loss_forward"


def _window(size: int) -> Convention:
    half = size // 2
    changes = ((_BLURRED, "<= 5", f"<= {half}"), (_BLURRED, "np.arange(-5, 6)", f"np.arange(-{half}, {half + 1})"))
    return Convention(f"a window of {size} x {size} pixels, not of 11 x 11", changes)


def _uniform(size: int) -> Convention:
    half = size // 2
    changes = ((_BLURRED, _KAPPA, f"np.where(np.abs(offset) <= {half}, 1.0, 0)"), (_BLURRED, _SUM, f"{size}"))
    return Convention(f"a uniform window of {size} x {size} pixels, not a Gaussian one", changes)


def _bordered(said: str, mode: str) -> Convention:
    """The window over an image continued by NumPy's `pad`."""
    taps = "np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))"
    rows = f'np.pad(np.eye(n), ((5, 5), (0, 0)), "{mode}")[k : k + n]'
    kappa = f"sum(w * {rows} for k, w in enumerate({taps})).T"
    return Convention(f"the image {said} under the window, not 0 outside", ((_BLURRED, _KAPPA, kappa),))


def _unbiased(size: int) -> Convention:
    factor = f"{size} / {size - 1}"
    return Convention(f"unbiased variances and covariance, times {factor}", (
        (_SSIM, _A2, f"2 * (blurred(x * y) - mu_x * mu_y) * {factor} + C2"),
        (_SSIM, _B2, f"(blurred(x**2) - mu_x**2 + blurred(y**2) - mu_y**2) * {factor} + C2"),
    ))  # fmt: skip


def _taps(said: str, taps: str) -> Convention:
    return Convention(f"the kernel {said}, not 1 4 6 4 1", ((_REDUCE, _TAPS, taps),))


def _edge(said: str, entry: str) -> Convention:
    return Convention(f"images {said} at the border of the kernel, not mirrored about the end pixel", (
        (_REDUCE, _FOLDED, "k = tap"), (_REDUCE, _ENTRY, entry),
    ))  # fmt: skip


def _pyr_up(said: str, scale: str) -> Convention:
    taps = f"zip(range(i - 2, i + 3), {_TAPS})"
    fold = "(lambda m: m if m < n else 2 * (n - 1) - m)(k % max(2 * (n - 1), 1))"
    row = f"sum(w / {scale} * np.eye(coarse.size)[{fold} // 2] for k, w in {taps} if {fold} % 2 == 0)"
    return Convention(f"images enlarged by zeros between the samples and the kernel, as pyrUp does{said}", (
        (_EXPAND, _INTERPOLATED, f"return np.array([{row} for i in range(n)])"),
    ))  # fmt: skip


def _sampled(said: str, near: tuple[str, str], far: tuple[str, str] = ("0 * r", "0 * r")) -> Convention:
    """A picture read by another kernel: its value and slope at a distance below 1, and from 1 to 2."""
    return Convention(f"the picture read {said}, not by the kernel of Keys with a = -1/2", (
        (_KEYS, "1 - 2.5 * r**2 + 1.5 * r**3, 2 - 4 * r + 2.5 * r**2 - 0.5 * r**3", f"{near[0]}, {far[0]}"),
        (_KEYS, "-5 * r + 4.5 * r**2, -4 + 5 * r - 1.5 * r**2", f"{near[1]}, {far[1]}"),
    ))  # fmt: skip


def _keys(a: float) -> Convention:
    return _sampled(
        f"by that with a = {a:g}",
        (f"({a} + 2) * r**3 - ({a} + 3) * r**2 + 1", f"3 * ({a} + 2) * r**2 - 2 * ({a} + 3) * r"),
        (f"{a} * (r**3 - 5 * r**2 + 8 * r - 4)", f"{a} * (3 * r**2 - 10 * r + 8)"),
    )


OF_IMAGES: tuple[Convention, ...] = (
    *map(_window, (5, 7, 9, 13)),
    *map(_uniform, (7, 8, 11)),
    _bordered("mirrored", "reflect"),
    _bordered("mirrored with its end pixel", "symmetric"),
    _bordered("repeated", "edge"),
    Convention("the window normalised over the pixels inside the image", (
        (_BLURRED, f"kappa = kappa / {_SUM}", "kappa = kappa / kappa.sum(axis=0)"),
    )),
    Convention("each window normalised by the tissue in it", (
        (_SSIM, "mu_x, mu_y = blurred(x), blurred(y)",
         "share = np.maximum(blurred(1.0 * np.broadcast_to(target.mask, x.shape)), 1e-12); "
         "mu_x, mu_y = blurred(x) / share, blurred(y) / share"),
        (_SSIM, "blurred(x * y) -", "blurred(x * y) / share -"),
        (_SSIM, _B2, "blurred(x**2) / share - mu_x**2 + blurred(y**2) / share - mu_y**2 + C2"),
    )),
    Convention("the mean of the map over the tissue whose window is inside the image", (
        (_SSIM, _MEAN, f"{_WITHIN}[:, target.mask[5:-5, 5:-5]].mean()"),
    )),
    Convention("the mean of the map over all pixels whose window is inside the image", (
        (_SSIM, _MEAN, f"{_WITHIN}.mean()"),
    )),
    Convention("the mean of the map over all pixels", ((_SSIM, _MEAN, "s.mean()"),)),
    Convention("C1 and C2 not squared: 0.01 and 0.03", ((_CONSTANTS, "0.01**2, 0.03**2", "0.01, 0.03"),)),
    Convention("C1 and C2 of images up to 255", ((_CONSTANTS, "0.01**2, 0.03**2", "2.55**2, 7.65**2"),)),
    *map(_unbiased, (121, 49)),
    Convention("images that are not masked before the window", ((_SSIM, _X, "rendered"), (*_Y, "observed"))),
    Convention("the rendered image not masked before the window", ((_SSIM, _X, "rendered"),)),
    Convention("the luminance left out of the map", ((_SSIM, _S, "s = a2 / b2"),)),
    Convention("the contrast left out of the map", ((_SSIM, _S, "s = a1 / b1"),)),
    Convention("the SSIM of the mean of the channels", (
        (_SSIM, _X, f"0 * rendered + {_X}.mean(axis=0)"), (*_Y, f"0 * observed + {_Y[1]}.mean(axis=0)"),
    )),
    _sampled("bilinearly", ("1 - r", "0 * r - 1")),
    _sampled("by the cubic B-spline", ("2 / 3 - r**2 + r**3 / 2", "1.5 * r**2 - 2 * r"),
             ("(2 - r) ** 3 / 6", "-((2 - r) ** 2) / 2")),
    *map(_keys, (-0.75, -1)),
    _taps("1 2 1", "(0, 4, 8, 4, 0)"),
    _taps("1 1 (the mean of two pixels)", "(0, 0, 8, 8, 0)"),
    _taps("1 1 1 1 1", "(3.2, 3.2, 3.2, 3.2, 3.2)"),
    _edge("repeated", "matrix[row, min(max(k, 0), n - 1)] += weight / 16"),
    _edge("continued by zeros", "matrix[row, min(max(k, 0), n - 1)] += weight / 16 * (0 <= k < n)"),
    _edge("mirrored with the end pixel",
          "matrix[row, k % (2 * n) if k % (2 * n) < n else 2 * n - 1 - k % (2 * n)] += weight / 16"),
    Convention("the kernel normalised over the pixels inside the image", (
        (_REDUCE, _ENTRY, "matrix[row, min(max(tap, 0), n - 1)] += weight * (0 <= tap < n)"),
        (_REDUCE, "return matrix", "return matrix / matrix.sum(axis=1, keepdims=True)"),
    )),
    _pyr_up("", "8"),
    _pyr_up(", without the factor 4", "16"),
    Convention("images enlarged by repeating samples (nearest)", (
        (_EXPAND, _INTERPOLATED, "return np.repeat(np.eye(coarse.size), 2, axis=0)[:n]"),
    )),
    Convention("the mask of a level subsampled: every second pixel of the one before", (
        (*_COARSE, "coarse = valid[::2, ::2]"),
    )),
    Convention("a coarse value valid if any pixel under the kernel is", (
        (*_COARSE, "coarse = d_rows @ valid @ d_columns.T"),
    )),
    Convention("squares of the band differences, not their magnitudes", (
        (_LOSS, "(weight * np.abs(p - q)).sum()", "(weight * (p - q) ** 2).sum()"),
        (_LOSS, "weight * np.sign(p - q)", "weight * 2 * (p - q)"),
    )),
)  # fmt: skip
