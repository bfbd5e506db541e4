"""Inputs by construction: what breaks programs is drawn on purpose, nothing is filtered out."""

import numpy as np
from hypothesis import strategies as st

from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER

DTYPES = st.sampled_from([np.float32, np.float64])
SEEDS = st.integers(0, 2**32 - 1)
RASTER = st.sampled_from([("definition", EXACT), ("definition", PAPER), ("blocks", PAPER), ("definition", LEGACY)])
CAMERA = Camera(np.eye(3), np.zeros(3), 9.0, 10.0, 4.8, 3.1, 9, 7)


def logit(alpha: float) -> float:
    """Inverse of the sigmoid for alpha in (0, 1)."""
    return float(np.log(alpha) - np.log1p(-alpha))


ORDINARY = st.floats(-4.0, 4.0)
LOGITS = st.one_of(
    ORDINARY,
    st.floats(0.99, 0.9999999).map(logit),  # at the clamp
    st.floats(-1e-9, 1e-9).map(lambda d: logit(1 / 255 + d)),  # at the cutoff
    st.sampled_from([-800.0, -40.0, 40.0, 800.0]),
)
LOG_SCALES = st.one_of(st.floats(-3.0, 1.0), st.sampled_from([-800.0, -40.0, 5.0, 12.0, 40.0, 41.0]))
QUATERNIONS = st.one_of(
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
    st.sampled_from([[0.0] * 4, [1e-30, 0.0, 0.0, 0.0], [1e15, -1e15, 1e15, 0.0], [0.0, 0.0, 0.0, -1.0]]),
)
NEAR = PAPER.near
HIDDEN = st.sampled_from([-3.0, -1e-12, 0.0, 1e-30, NEAR])
DEPTHS = st.one_of(st.floats(0.5, 9.0), st.sampled_from([2.0, 2.0, 3.0]), st.just(float(np.nextafter(NEAR, 1))))


@st.composite
def scenes(draw, most: int = 7, depths=DEPTHS, distinct: bool = False, tame: bool = False, dtype=None) -> Scene:
    """Up to `most` Gaussians around the view of CAMERA, degree 0.

    distinct   all depths differ;  tame   axes, opacities and quaternions of ordinary size only
    """
    n = draw(st.integers(0, most))
    dtype = draw(DTYPES) if dtype is None else dtype
    listed = lambda items, unique=False: draw(st.lists(items, min_size=n, max_size=n, unique=unique))
    if distinct:
        z = np.array(listed(st.integers(1, 60), unique=True), float) / 8 + 0.5
    else:
        z = np.array(listed(st.one_of(depths, HIDDEN) if depths is DEPTHS else depths), float)
    u, v = (np.array(listed(st.floats(-0.2, 1.2)), float) * size for size in (CAMERA.width, CAMERA.height))
    position = np.stack([(u - CAMERA.cx) / CAMERA.fx * z, (v - CAMERA.cy) / CAMERA.fy * z, z])
    turns = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(lambda q: [1.0, *q]) if tame else QUATERNIONS
    quaternion = np.array(listed(turns), float).reshape(n, 4).T
    axes = st.floats(-3.0, 1.0) if tame else LOG_SCALES
    log_scale = np.array([listed(axes) for _ in range(3)], float).reshape(3, n)
    opacity = np.array(listed(ORDINARY if tame else LOGITS), float)
    colour = np.random.default_rng(draw(SEEDS)).uniform(0.0, 1.2, (1, 3, n))
    parts = (position, quaternion, log_scale, opacity, (colour - 0.5) / Y00)
    return Scene(*(np.ascontiguousarray(a, dtype) for a in parts))


@st.composite
def shapes(draw, largest: int = 24) -> tuple[int, int]:
    """Heights and widths: one, odd, even, smaller than any window."""
    side = st.one_of(st.integers(1, 5), st.integers(6, largest))
    return draw(side), draw(side)


@st.composite
def masks(draw, shape) -> np.ndarray:
    """Nothing, everything, a tool from the border, single holes, or single islands."""
    mask = np.ones(shape, bool)
    for _ in range(draw(st.integers(0, 2))):
        top, left = draw(st.integers(0, shape[0] - 1)), draw(st.integers(0, shape[1] - 1))
        mask[top : top + draw(st.integers(1, 12)), left : left + draw(st.integers(1, 12))] = False
    for _ in range(draw(st.integers(0, 3))):
        mask[draw(st.integers(0, shape[0] - 1)), draw(st.integers(0, shape[1] - 1))] = False
    return draw(st.sampled_from([mask, mask, mask, ~mask, np.zeros(shape, bool)]))


@st.composite
def image_pairs(draw, largest: int = 24):
    """rendered, observed (3, H, W) in [0, 1.2], and a mask."""
    shape, dtype = draw(shapes(largest)), draw(DTYPES)
    rng = np.random.default_rng(draw(SEEDS))
    rendered, observed = (rng.uniform(0, 1.2, (3, *shape)).astype(dtype) for _ in range(2))
    if draw(st.booleans()):
        rendered = observed.copy()  # residuals of exactly 0
    return rendered, observed, draw(masks(shape))


def poisons(dtype):
    """What may lie under an instrument."""
    top = float(np.finfo(dtype).max)
    return st.sampled_from([np.nan, np.inf, -np.inf, top, -top, float(np.finfo(dtype).smallest_subnormal)])
