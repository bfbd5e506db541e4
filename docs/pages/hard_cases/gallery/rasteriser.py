"""Gallery: projection, compositing, colour, order."""

import mpmath
import numpy as np

from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.binning import depth_order
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import Shape, covariance_forward
from endotsr.method.splatting.harmonics import harmonics_forward
from endotsr.method.splatting.projection import footprint, projection_forward
from endotsr.method.splatting.records import log_opacity
from endotsr.method.splatting.render import Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT
from pages.hard_cases.gallery.registry import case

PIXEL = Camera(np.eye(3), np.zeros(3), 10.0, 10.0, 0.5, 0.5, 1, 1)


def needle(dtype, length):
    """A needle of `length` px at 45 degrees, 1 px wide, projected; its rotation (short entries) and semi-axes."""
    s = 0.70703125
    rotation = np.array([[s, -s, 0], [s, s, 0], [0, 0, 1]], dtype)[:, :, None]
    scale = np.array([[length / 128], [1 / 128], [1 / 128]], dtype)
    camera = PIXEL._replace(fx=128.0, fy=128.0)
    out, _ = projection_forward(np.array([[0], [0], [1]], dtype), Shape(rotation, scale), camera, EXACT)
    return out, rotation[:, :, 0], scale[:, 0]


def exact_needle(dtype, rotation, scale):
    """a, b, c of `needle` as mpmath numbers, from the rounded inputs."""
    rows = [[128 * mpmath.mpf(float(rotation[i, k])) * mpmath.mpf(float(scale[k])) for k in range(3)] for i in range(2)]
    low_pass = mpmath.mpf(float(dtype(0.3)))
    a, c = (sum(x * x for x in row) + low_pass for row in rows)
    return a, sum(x * y for x, y in zip(*rows)), c


@case(
    "C1",
    "The determinant of a needle",
    naive="`a * c - b * b`",
    bound=40,
    why="A needle of 3000 px seen at 45° has a ≈ b ≈ c ≈ 4.5 million. Two products near 2e13 are subtracted, and "
    "the result is 12 million. Where the computed difference is zero or less, programs clamp it, and the needle "
    "becomes a disc or vanishes.",
)
def determinant(dtype):
    out, rotation, scale = needle(dtype, 3000)
    a, b, c = out.covariance2d[:, 0]
    with mpmath.workdps(60):
        p, q, r = exact_needle(dtype, rotation, scale)
        return float(p * r - q * q), a * c - b * b, out.determinant[0]


@case(
    "C2",
    "Mahalanobis distance at the tip of a needle",
    naive="`(c*dx*dx - 2*b*dx*dy + a*dy*dy) / det`",
    bound=40,
    why="The same cancellation occurs at every pixel: terms of 2.5e11 leave 1e6, even with the right determinant. "
    'Released programs have a line "power > 0: skip" for the pixels where the computed distance is negative. A '
    "sum of two squares is never negative. (1000 px; the bound grows with the distance from the centre.)",
)
def mahalanobis(dtype):
    out, rotation, scale = needle(dtype, 1000)
    a, b, c = out.covariance2d[:, 0]
    dx = dy = dtype(707)
    slope = footprint(out)[:, 0]
    eta = dx - slope[1] * dy
    ours = slope[2] * dy * dy + slope[0] * eta * eta
    with mpmath.workdps(60):
        p, q, r = exact_needle(dtype, rotation, scale)
        truth = (r - 2 * q + p) * 707**2 / (p * r - q * q)
    return float(truth), (c * dx * dx - dtype(2) * b * dx * dy + a * dy * dy) / out.determinant[0], ours


@case(
    "Q1",
    "A very short quaternion",
    naive="`q / sqrt(w*w + x*x + y*y + z*z)`",
    bound=8,
    why="The squares underflow long before the numbers do. Deformation adds to the raw quaternion, so short "
    "quaternions occur. (Entry R₁₀ for a length of 1e-200 in float64 and 1e-30 in float32.)",
)
def quaternion(dtype):
    q = np.array([0.5, 0.25, -0.75, 0.125]) * (1e-200 if dtype is np.float64 else 1e-30)
    q = q.astype(dtype)[:, None]
    w, x, y, z = (q / np.sqrt((q * q).sum(axis=0)))[:, 0]
    ours = covariance_forward(q, np.zeros((3, 1), dtype))[0].rotation[1, 0, 0]
    with mpmath.workdps(60):
        w_, x_, y_, z_ = (mpmath.mpf(float(v)) for v in q[:, 0])
        truth = float(2 * (x_ * y_ + w_ * z_) / (w_**2 + x_**2 + y_**2 + z_**2))
    return truth, dtype(2) * (x * y + w * z), ours


def stack(alphas, dtype, opaque_logit=800.0):
    """Splats of known alpha on the only pixel, nearest first, the first red and the others black."""
    alphas = np.asarray(alphas, float)
    n = alphas.size
    logit = np.full(n, opaque_logit)
    below = alphas < 1
    logit[below] = np.log(alphas[below]) - np.log1p(-alphas[below])
    colour = np.zeros((1, 3, n))
    colour[0, 0, 0] = 1.0
    z = 1.0 + 0.001 * np.arange(n)
    parts = (np.stack([0 * z, 0 * z, z]), np.tile([[1.0], [0], [0], [0]], n), np.zeros((3, n)), logit)
    return Scene(*(a.astype(dtype) for a in (*parts, (colour - 0.5) / Y00)))


def weight_gradient(alphas, dtype):
    """d red / d alpha of the first splat, from the gradient with respect to its logit."""
    scene = stack(alphas, dtype)
    out, saved = render_forward(scene, PIXEL, EXACT, degree=0)
    up = np.zeros_like(out.colour)
    up[0] = 1
    back = render_reverse(up, np.zeros_like(out.depth), None, saved)
    return back.d_opacity_logit[0] / (dtype(alphas[0]) * (dtype(1) - dtype(alphas[0])))


def by_division(alphas, dtype):
    """T in front of the first splat, recovered from the last one as released programs do in their reverse pass."""
    through = [dtype(1) - dtype(alpha) for alpha in alphas]
    t = dtype(1)
    for factor in through:
        t *= factor
    for factor in reversed(through):
        t /= factor
    return t


@case(
    "A4",
    "Reverse pass through an opaque Gaussian",
    naive="`T = T / (1 - alpha)`, back to front",
    bound=8,
    why="The transmittance is not stored but recovered by division. Once an alpha is 1, this is 0/0. A clamp of alpha "
    "at 0.99, as released programs have it, avoids this. (Gradient of the red of one pixel with respect to the first "
    "of three alphas, 0.3, 1 and 0.5; only the first is red.)",
)
def opaque(dtype):
    return 1.0, by_division([0.3, 1.0, 0.5], dtype), weight_gradient([0.3, 1.0, 0.5], dtype)


@case(
    "A4",
    "Reverse pass through 8000 faint Gaussians",
    naive="`T = T / (1 - alpha)`, back to front",
    bound=8,
    why="The product falls to the subnormal numbers and stays at one of them, because 0.98 times this number rounds "
    "to itself. The divisions then amplify it. A stop at T = 1e-4 avoids this; without a stop the wrong value "
    "is the result. (Alpha 0.02 each; the same gradient.)",
)
def faint(dtype):
    alphas = [0.02] * 8000
    return 1.0, by_division(alphas, dtype), weight_gradient(alphas, dtype)


@case(
    "A4",
    "Opacity of one faint splat",
    naive="`1 - T`",
    bound=8,
    why="In float32 1 - 1e-8 is 1. The sum of the weights keeps the digits that the product loses. (This is the "
    "renderer without a cutoff. The fast path of `paper` computes 1 - T: below its cutoff of 1/255 no splat is drawn.)",
)
def opacity(dtype):
    scene = stack([1e-8], dtype)
    value = render_forward(scene, PIXEL, EXACT, degree=0)[0].opacity[0, 0]
    with mpmath.workdps(60):
        truth = float(1 / (1 + mpmath.exp(-mpmath.mpf(float(scene.opacity_logit[0])))))
    return truth, dtype(1) - (dtype(1) - dtype(1e-8)), value


@case(
    "A7",
    "Log-opacity of a logit of -800",
    naive="`log(1 / (1 + exp(-x)))`",
    bound=8,
    why="exp overflows, the sigmoid is 0 and its logarithm is minus infinity. The gradient then contains 0 · ∞.",
)
def log_sigmoid(dtype):
    x = np.array([-800], dtype)
    return -800.0, np.log(dtype(1) / (dtype(1) + np.exp(-x)))[0], log_opacity(x)[0]


@case(
    "H1",
    "A Gaussian at the camera centre",
    naive="`direction = v / norm(v)`",
    bound=8,
    why="The viewing direction is 0/0, and the NaN reaches the colour and every pixel of the Gaussian. This occurs "
    "with a camera at the origin and a centre initialised at 0. Without a direction only degree 0 remains, here 0.7.",
)
def at_the_camera(dtype):
    h = np.full((4, 3, 1), 0.2 / Y00, dtype)
    v = np.zeros(3, dtype)
    direction = v / np.sqrt((v * v).sum())
    naive = dtype(0.5) + dtype(Y00) * h[0, 0, 0] + (dtype(0.4886) * direction * h[1:, 0, 0]).sum()
    ours = harmonics_forward(h, None, np.zeros((3, 1), dtype), np.zeros(3, dtype), 1)[0][0, 0]
    return 0.7, naive, ours


@case(
    "S2",
    "How many depths the sort can tell apart",
    naive="NDC depth in float32, planes 0.01 and 100",
    bound=0,
    why="Of 200 001 depths between 20 and 100 only a few thousand distinct values remain, and the order within each "
    "is arbitrary. View z keeps all of them distinct in either precision.",
)
def depth_values(dtype):
    z = np.linspace(20, 100, 200_001).astype(dtype)
    near, far = np.float32(0.01), np.float32(100)
    ndc = far * (z.astype(np.float32) - near) / (z.astype(np.float32) * (far - near))
    order = depth_order(z[::-1].copy(), np.ones(z.size, bool))
    assert (order == np.arange(z.size)[::-1]).all()
    return 200_001, np.unique(ndc).size, np.unique(z).size
