"""The common workload: N Gaussians on a wavy, tissue-like surface, seen by one camera.

The Gaussians are flat discs, most of which face the camera. `SIGMA_PIXELS` is the median of their semi-axes in pixels,
without the thin one, by number. The part `OPAQUE_FRACTION` is nearly opaque (0.6 to 0.98), the rest faint (0.03 to
0.5). The surface extends beyond each image border by `BORDER` of the image. All draws are seeded: equal arguments give
equal arrays. Scene units are arbitrary; the depth is about 4.
"""

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS, Gaussians, arrays

WIDTH, HEIGHT, FOCAL = 640, 512, 570.0
SIGMA_PIXELS = {20_000: 3.6, 60_000: 2.4, 150_000: 1.7}
BORDER = 0.04  # fraction of the image by which the surface extends beyond each border
OPAQUE_FRACTION = 0.55
FRAMES = 9  # default number of frames of the sequence: frame 1 is held out


def camera(width: int = WIDTH, height: int = HEIGHT) -> Camera:
    """The camera, at the origin, looking along z; the focal length is proportional to the width."""
    focal = FOCAL * width / WIDTH
    return Camera(np.eye(3), np.zeros(3), focal, focal, width / 2, height / 2, width, height)


def surface(column: FloatArray, row: FloatArray) -> FloatArray:
    """Depth of the surface at image positions, in pixels of the 640x512 image."""
    fine = 0.15 * np.sin((column + 2 * row) / 29.0)
    return 4.0 + 0.35 * np.sin(column / 61.0) * np.cos(row / 47.0) + fine


def gaussians(count: int, config: Config, seed: int = 7, size: float = 1.0) -> Gaussians:
    """The scene, with the time bases and residuals of `config.model`, in `config.training.precision`.

    size  factor on the semi-axes, which changes the pixels per Gaussian
    """
    rng = np.random.default_rng(seed)
    column = rng.uniform(-BORDER * WIDTH, (1 + BORDER) * WIDTH, count)
    row = rng.uniform(-BORDER * HEIGHT, (1 + BORDER) * HEIGHT, count)
    depth = surface(column, row) + rng.normal(0, 0.01, count)
    position = np.stack([(column - WIDTH / 2) / FOCAL * depth, (row - HEIGHT / 2) / FOCAL * depth, depth])
    sigma = SIGMA_PIXELS.get(count, 2.4 * np.sqrt(60_000 / count)) * depth.mean() / FOCAL
    scale = size * sigma * np.exp(rng.normal(0, 0.45, (count, 3))).T
    scale[2] *= 0.25
    quaternion = _facing(rng, count)
    opaque = rng.random(count) < OPAQUE_FRACTION
    opacity = np.where(opaque, rng.uniform(0.6, 0.98, count), rng.uniform(0.03, 0.5, count))
    coefficients = (config.model.harmonics_degree + 1) ** 2
    harmonics = rng.normal(0, 0.05, (coefficients, 3, count))
    harmonics[0] = rng.uniform(-1.2, 1.2, (3, count))
    scene = Gaussians(
        position=position,
        quaternion=quaternion,
        log_scale=np.log(scale),
        opacity_logit=np.log(opacity / (1 - opacity)),
        harmonics=harmonics,
    )
    dtype = np.dtype(config.training.precision)
    scene = Gaussians(**{name: np.ascontiguousarray(a, dtype=dtype) for name, a in arrays(scene).items()})
    return scene._replace(**temporal(rng, count, config, sigma))


def _facing(rng: np.random.Generator, count: int) -> FloatArray:
    """Quaternions (4, N): a random spin, then a tilt (normal, 0.3 rad) about a random axis in the picture plane."""
    tilt, azimuth, spin = rng.normal(0, 0.3, count) / 2, rng.uniform(0, 2 * np.pi, count), rng.uniform(0, np.pi, count)
    cos, sin_x, sin_y = np.cos(tilt), np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)
    w, z = np.cos(spin), np.sin(spin)
    return np.stack([cos * w, sin_x * w + sin_y * z, sin_y * w - sin_x * z, cos * z])


def temporal(rng: np.random.Generator, count: int, config: Config, sigma: float) -> dict[str, FloatArray]:
    """Small time-dependent parameters: every Gaussian moves, so no branch is skipped."""
    model, made = config.model, {}
    dtype = np.dtype(config.training.precision)
    if model.deformation:
        shape = (DEFORMATION_CHANNELS, model.bases, count)
        made["fdm_weight"] = _normal(rng, 0.02 * sigma, shape, dtype)
        made["fdm_centre"] = _normal(rng, 0.01, shape, dtype, np.linspace(0, 1, model.bases))
        made["fdm_width"] = np.full(shape, max(model.initial_width, 0.05), dtype)
    shape = (3, 2 * model.frequencies, count)
    if model.appearance:
        made["appearance_coefficients"] = _normal(rng, 0.02, shape, dtype)
    if model.spectral_motion:
        made["motion_coefficients"] = _normal(rng, 0.02 * sigma, shape, dtype)
    return made


def _normal(
    rng: np.random.Generator, sigma: float, shape: tuple[int, ...], dtype: np.dtype, middle: FloatArray | None = None
) -> FloatArray:
    """Normal numbers about `middle` (one per index of the second axis).

    Drawing row by row avoids a float64 copy of the whole array.
    """
    out = np.empty(shape, dtype)
    for block in out:
        for j, row in enumerate(block):
            row[:] = rng.normal(0, sigma, row.size) + (0.0 if middle is None else middle[j])
    return out


def sequence(width: int = WIDTH, height: int = HEIGHT, *, frames: int = FRAMES) -> Sequence:
    """Target frames: a smooth moving pattern with fine texture, with one corner covered by an instrument."""
    rng = np.random.default_rng(11)
    row, column = np.mgrid[0:height, 0:width].astype(np.float64)
    column, row = column * (WIDTH / width), row * (HEIGHT / height)
    depth = surface(column, row).astype(np.float32)
    texture = rng.normal(0, 12, (3, height, width))
    phase = np.array([0.0, 1.0, 2.0])[:, None, None]
    step = FRAMES / frames  # more frames are a finer sampling of the same clip
    images = np.empty((frames, 3, height, width), np.uint8)
    masks = np.ones((frames, height, width), bool)
    for i in range(frames):
        wave = np.sin(column / 40 + phase + 0.2 * step * i) * np.cos(row / 35 - 0.1 * step * i)
        images[i] = np.clip(128 + 70 * wave + texture, 0, 255)
        edge = WIDTH * (0.55 + 0.02 * step * i)
        masks[i] = ~((column > edge) & (row > 0.55 * HEIGHT))
    index = np.arange(frames)
    view = camera(width, height)
    return Sequence(
        images=images,
        masks=masks,
        depth=np.where(masks, depth, np.float32(0)),
        times=index / frames,
        cameras=[view] * frames,
        names=[f"{i:06d}" for i in index],
        unit="scene units",
        static_camera=True,
        train_index=np.delete(index, 1),
        test_index=index[1:2],
    )
