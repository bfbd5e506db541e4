"""Gallery: temporal equations, losses, calibration."""

import mpmath
import numpy as np

from endotsr.method.equations.appearance import appearance_forward
from endotsr.method.equations.calibration import calibrate
from endotsr.method.equations.dictionary import dictionary_forward, frequencies
from endotsr.method.equations.laplacian import laplacian_levels, laplacian_loss_forward, support_masks
from endotsr.method.equations.matern import matern_weights
from endotsr.method.kernels.constants import Y00
from endotsr.method.losses.masked_l1 import masked_l1_forward
from endotsr.method.losses.masked_ssim import masked_ssim_forward, ssim_target
from pages.hard_cases.gallery.registry import case


@case(
    "H3",
    "A colour residual of 3e-10",
    naive="`(colour + residual) - colour`",
    bound=8,
    why="As a difference of two colours near 0.5, a small residual is rounding noise or 0.",
)
def residual(dtype):
    x = dtype(1e-9)
    ours = appearance_forward(np.full((3, 1, 1), x), np.ones(1, dtype), 0.3)[0][0, 0] * dtype(Y00)
    return 0.3 * float(x), (dtype(0.5) + dtype(0.3) * np.tanh(x)) - dtype(0.5), ours


@case(
    "T1",
    "Slope of tanh at 20",
    naive="`1 - tanh(x)**2`",
    bound=8,
    why="tanh is rounded to 1 and the slope to 0, so a saturated residual could never change again. As 4e/(1 + e)² "
    "with e = exp(-2x) the slope keeps its digits.",
)
def slope(dtype):
    saved = appearance_forward(np.full((3, 1, 1), 20, dtype), np.ones(1, dtype), Y00)[1]
    with mpmath.workdps(60):
        truth = float(1 - mpmath.tanh(20) ** 2)
    return truth, dtype(1) - np.tanh(dtype(20)) ** dtype(2), saved.slope[0, 0]


@case(
    "W1",
    "sin(2π · 16 t) at t = 31/32",
    naive="`sin(2 * pi * 16 * t)`",
    bound=0,
    why="π is rounded before the sine is evaluated. This atom is 0 on every frame of a 32-frame clip. The result of "
    "the naive form is noise, and normalisation by its RMS amplifies it to size 1.",
)
def phase(dtype):
    t = dtype(31 / 32)
    return 0.0, np.sin(dtype(2 * np.pi) * dtype(16) * t), dictionary_forward(float(t), np.array([16], dtype))[0][0]


@case(
    "M1",
    "Matérn weight for a correlation length of 1e-60",
    naive="`s / mean(s)`, `s = (5/l**2 + w**2)**3`",
    bound=4,
    why="The result is ∞/∞ as soon as the cube overflows: below l = 8e-7 in float32, 9e-52 in float64. The limit is "
    "white noise, with every weight 1.",
)
def matern(dtype):
    omega = frequencies(8, 1, 16, dtype)
    density = (dtype(5) / dtype(1e-60) ** 2 + (dtype(2 * np.pi) * omega) ** 2) ** 3
    return 1.0, (density / density.mean())[0], matern_weights(omega, 1e-60)[0]


@case(
    "L1",
    "Zero border in the pyramid",
    naive="5-tap filter with zeros outside",
    bound=4,
    why="A constant image has no detail. With zeros outside the image, the bands at its corners are half its "
    "brightness.",
)
def border(dtype):
    taps = np.array([1, 4, 6, 4, 1], dtype) / dtype(16)
    line = np.convolve(np.ones(16, dtype), taps, mode="same")[::2]
    corner = dtype(1) - line[0] * line[0]
    return 0.0, corner, np.abs(laplacian_levels(np.ones((3, 16, 16), dtype)).bands[0]).max()


@case(
    "L5",
    "A pyramid level without a valid value",
    naive="`mean(abs(difference[valid]))`",
    bound=0,
    why="With instruments close together, every support of 37 pixels contains an excluded pixel. The mean of an "
    "empty set is NaN, and one NaN ends a training run. Such a level has loss 0.",
)
def empty_level(dtype):
    a, b = np.zeros((3, 16, 16), dtype), np.ones((3, 16, 16), dtype)
    masks = support_masks(np.zeros((16, 16), bool))
    return 0.0, np.abs((a - b)[:, masks.bands[0]]).mean(), laplacian_loss_forward(a, b, masks)[0]


@case(
    "L6",
    "NaN under the instrument",
    naive="`sum(mask * abs(I - J)) / sum(mask)`",
    bound=2,
    why="0 · NaN is NaN. A mask selects and does not multiply; the same holds for the gradient.",
)
def under_the_mask(dtype):
    a, b, mask = np.full((3, 4, 4), 0.75, dtype), np.full((3, 4, 4), 0.5, dtype), np.ones((4, 4), bool)
    a[:, 0, 0], mask[0, 0] = np.nan, False
    return 0.25, (mask * np.abs(a - b)).sum() / dtype(3 * mask.sum()), masked_l1_forward(a, b, mask)[0]


@case(
    "X1",
    "1 - SSIM of two bright, even images",
    naive="`mean(x*x) - mean(x)**2`",
    bound=1000,
    why="In float32 the variance of a wall lit at 0.95 is a difference of numbers near 0.9. Its error can be as large "
    "as the variance itself, and the result can be negative. Moments of the sum and of the difference of the images, "
    "about the centre of the window, have no large terms to subtract.",
)
def similarity(dtype):
    rng = np.random.default_rng(3)
    y = (0.95 + 1e-3 * rng.standard_normal((1, 40, 40))).astype(np.float32)
    x = (y + 1e-3 * rng.standard_normal(y.shape)).astype(np.float32)
    ours = 1 - masked_ssim_forward(x.astype(dtype), ssim_target(y.astype(dtype), np.ones((40, 40), bool)))[0]
    return 1 - moment_ssim(x, y, np.longdouble), 1 - moment_ssim(x, y, dtype), ours


def moment_ssim(x, y, dtype):
    """The textbook form, 11x11 Gaussian window, zeros outside."""
    taps = np.exp(-(np.arange(-5, 6, dtype=dtype) ** 2) / dtype(4.5))
    taps /= taps.sum()

    def blur(image):
        for axis in (1, 2):
            image = np.apply_along_axis(lambda row: np.convolve(row, taps, mode="same"), axis, image)
        return image

    x, y, two, c1, c2 = x.astype(dtype), y.astype(dtype), dtype(2), dtype(1e-4), dtype(9e-4)
    mx, my = blur(x), blur(y)
    xx, yy, xy = blur(x * x) - mx * mx, blur(y * y) - my * my, blur(x * y) - mx * my
    return ((two * mx * my + c1) * (two * xy + c2) / ((mx * mx + my * my + c1) * (xx + yy + c2))).mean()


@case(
    "K1",
    "A view without any gradient in the calibration",
    naive="`r / median(g_lap / g_rgb)`",
    bound=8,
    why="One fully masked frame gives 0/0. The median of a list with a NaN is NaN, so the Laplacian weight is NaN. "
    "The view is dropped and listed; if no view remains, an error is raised.",
)
def dead_view(dtype):
    rgb, lap = np.array([1.0, 0.0, 1.0, 1.0], dtype), np.array([0.25, 0.0, 0.5, 0.125], dtype)
    views = [(str(i), float(a), float(b)) for i, (a, b) in enumerate(zip(rgb, lap))]
    return 1.0, dtype(0.25) / np.median(lap / rgb), calibrate(views, 0.25).lambda_lap
