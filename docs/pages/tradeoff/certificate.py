"""Verification of the reference: the exact path against its own limit, and against 30 decimal digits.

Three statements, each with its figure. The exact path equals a cutoff of 1e-14, so no support, stop or clamp loses
anything. Cutoffs of 1e-12 and 1e-14 agree, so the limit is reached. Twenty pixels, computed in mpmath from the raw
parameters by the formulas alone, equal the pixels of the exact path.

The difference between 1e-12 and 1e-14 depends on the scene: a few 1e-12 on a surface, and tens of 1e-12 where hundreds
of faint Gaussians overlap, each of which loses its rim. The error of the reference is a hundred times smaller.
"""

from typing import Any, NamedTuple

import mpmath
import numpy as np

from endotsr.method.kernels.arrays import FloatArray, IntArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene, render_forward
from endotsr.method.splatting.settings import RasterSettings
from endotsr.studies.tradeoff.scenes import StudyScene, in_precision
from endotsr.studies.tradeoff.settings import CLOSE
from endotsr.training.fitting.model import scene_at

PIXELS = 20
DIGITS = 30
LIMIT = 1e-10  # display units, between cutoffs 1e-12 and 1e-14
ROUNDING = 1e-12  # display units: rounding of float64 over a few thousand Gaussians
NEGLIGIBLE = 80.0  # half a squared distance beyond which alpha < 2e-35 is below the digits carried


class Certificate(NamedTuple):
    """Largest differences of the colour, display units."""

    exact_against_1e14: float
    cut_1e12_against_1e14: float
    pixels_against_mpmath: float
    pixels: int

    @property
    def holds(self) -> bool:
        """Whether every statement is true."""
        return (
            self.exact_against_1e14 <= ROUNDING
            and self.cut_1e12_against_1e14 <= LIMIT
            and self.pixels_against_mpmath <= ROUNDING
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict() | {"holds": self.holds}


def certify(study: StudyScene, exact: FloatArray, settings: RasterSettings) -> Certificate:
    """Check the colour (3, H, W) of the scene rendered with `settings` (preset `exact`) in float64."""
    scene, _ = scene_at(in_precision(study.gaussians, "float64"), study.spectral, study.model, study.time)
    near = CLOSE._replace(near=study.near)
    cuts = [
        render_forward(scene, study.camera, near._replace(alpha_cutoff=c), degree=study.degree)[0].colour
        for c in (1e-12, 1e-14)
    ]
    rng = np.random.default_rng(0)
    rows, columns = rng.integers(study.camera.height, size=PIXELS), rng.integers(study.camera.width, size=PIXELS)
    digits = pixels_in_digits(scene, study.camera, settings, study.degree, rows, columns)
    return Certificate(
        float(np.abs(exact - cuts[1]).max()),
        float(np.abs(cuts[0] - cuts[1]).max()),
        float(np.abs(exact[:, rows, columns] - digits).max()),
        PIXELS,
    )


def pixels_in_digits(
    scene: Scene, camera: Camera, settings: RasterSettings, degree: int, rows: IntArray, columns: IntArray
) -> FloatArray:
    """Colours (3, P) of pixels by equations (B2) to (B5) without cutoff, stop or clamp, in 30 digits, on black."""
    with mpmath.workdps(DIGITS):
        rotation, translation = mpmath.matrix(camera.rotation.tolist()), mpmath.matrix(camera.translation.tolist())
        splats: dict[int, Any] = {}
        out = np.empty((3, len(rows)))
        for p, (row, column) in enumerate(zip(rows, columns, strict=True)):
            x, y = mpmath.mpf(int(column)) + 0.5, mpmath.mpf(int(row)) + 0.5
            left, colour = mpmath.mpf(1), [mpmath.mpf(0)] * 3
            for i in _candidates(scene, camera, settings, int(row), int(column)):
                if i not in splats:
                    splats[i] = _splat(scene, i, camera, rotation, translation, settings, degree)
                u, v, a, b, c, opacity, rgb = splats[i]
                dx, dy = x - u, y - v
                q = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / (a * c - b * b)
                alpha = opacity * mpmath.exp(-q / 2)
                colour = [total + alpha * left * own for total, own in zip(colour, rgb, strict=True)]
                left *= 1 - alpha
            out[:, p] = [float(value) for value in colour]
        return out


def _candidates(scene: Scene, camera: Camera, settings: RasterSettings, row: int, column: int) -> list[int]:
    """Gaussians that may contribute to a pixel, nearest first: |d|^2 / 2 within `NEGLIGIBLE` of the largest variance
    that their longest axis can have on the screen."""
    x, y, z = camera.rotation @ scene.position + camera.translation[:, None]
    seen = z > settings.near
    x, y, z = x[seen] / z[seen], y[seen] / z[seen], z[seen]
    focal, axis = max(camera.fx, camera.fy), np.exp(scene.log_scale.max(axis=0)[seen])
    variance = (focal * axis / z) ** 2 * (1 + x * x + y * y) + settings.low_pass
    du, dv = column + 0.5 - (camera.fx * x + camera.cx), row + 0.5 - (camera.fy * y + camera.cy)
    index = np.flatnonzero(seen)[(du * du + dv * dv) / (2 * variance) <= NEGLIGIBLE]
    depth = (camera.rotation @ scene.position[:, index] + camera.translation[:, None])[2]
    return [int(i) for i in index[np.argsort(depth, kind="stable")]]


def _splat(scene: Scene, i: int, camera: Camera, rotation, translation, settings: RasterSettings, degree: int):
    """Mean, covariance, opacity and colour of Gaussian i on the screen."""
    position = mpmath.matrix(scene.position[:, i].tolist())
    x, y, z = rotation * position + translation
    w, i_, j, k = (mpmath.mpf(float(value)) for value in scene.quaternion[:, i])
    n = mpmath.sqrt(w * w + i_ * i_ + j * j + k * k)
    w, i_, j, k = (
        (w / n, i_ / n, j / n, k / n) if n > 0 else (mpmath.mpf(1), mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(0))
    )
    own = mpmath.matrix([
        [1 - 2 * (j * j + k * k), 2 * (i_ * j - w * k), 2 * (i_ * k + w * j)],
        [2 * (i_ * j + w * k), 1 - 2 * (i_ * i_ + k * k), 2 * (j * k - w * i_)],
        [2 * (i_ * k - w * j), 2 * (j * k + w * i_), 1 - 2 * (i_ * i_ + j * j)],
    ])  # fmt: skip
    scale = mpmath.diag([mpmath.exp(mpmath.mpf(float(value))) for value in scene.log_scale[:, i]])
    jacobian = mpmath.matrix([[camera.fx / z, 0, -camera.fx * x / z**2], [0, camera.fy / z, -camera.fy * y / z**2]])
    footprint = jacobian * rotation * own * scale
    covariance = footprint * footprint.T
    a, b, c = covariance[0, 0] + settings.low_pass, covariance[0, 1], covariance[1, 1] + settings.low_pass
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    opacity = 1 / (1 + mpmath.exp(-mpmath.mpf(float(scene.opacity_logit[i]))))
    return u, v, a, b, c, opacity, _colour(scene, i, position, rotation, translation, degree)


def _colour(scene: Scene, i: int, position, rotation, translation, degree: int) -> list[Any]:
    """(B4): max(0, 1/2 + sum Y_k h_k), with the residual of equation (2) in the degree-0 coefficient."""
    direction = position + rotation.T * translation
    length = mpmath.norm(direction)
    x, y, z = direction / length if length > 0 else mpmath.matrix([0, 0, 0])
    basis = _harmonics(x, y, z)[: (degree + 1) ** 2] if length > 0 else _harmonics(x, y, z)[:1]
    found = []
    for channel in range(3):
        h = [mpmath.mpf(float(value)) for value in scene.harmonics[: len(basis), channel, i]]
        if scene.residual is not None:
            h[0] += mpmath.mpf(float(scene.residual[channel, i]))
        found.append(max(mpmath.mpf(0), 0.5 + mpmath.fdot(basis, h)))
    return found


def _harmonics(x, y, z) -> list[Any]:
    """Real spherical harmonics of degree 0 to 3 in the order and with the signs of the specification."""
    pi, root, h = mpmath.pi, mpmath.sqrt, mpmath.mpf(1) / 2
    c1, c2, c20 = root(3 / (4 * pi)), h * root(15 / pi), root(5 / pi) / 4
    c33, c32, c31, c30 = root(35 / (2 * pi)) / 4, h * root(105 / pi), root(21 / (2 * pi)) / 4, root(7 / pi) / 4
    xx, yy, zz = x * x, y * y, z * z
    return [
        h / root(pi),
        -c1 * y, c1 * z, -c1 * x,
        c2 * x * y, -c2 * y * z, c20 * (2 * zz - xx - yy), -c2 * x * z, h * c2 * (xx - yy),
        -c33 * y * (3 * xx - yy), c32 * x * y * z, -c31 * y * (4 * zz - xx - yy),
        c30 * z * (2 * zz - 3 * xx - 3 * yy), -c31 * x * (4 * zz - xx - yy), h * c32 * z * (xx - yy),
        -c33 * x * (xx - 3 * yy),
    ]  # fmt: skip
