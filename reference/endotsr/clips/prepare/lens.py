"""Warnings on a lens model: whether it is one-to-one over the picture, and whether its coefficients are in order.

In: camera matrix and distortion coefficients of OpenCV. Out: warnings. Beyond the radius at which the model turns back,
straightened pictures show parts of the source twice: the coefficients are wrong, in another order, or of another lens.
"""

import numpy as np

from endotsr.method.kernels.arrays import FloatArray

STEPS = 1000  # radii between the axis and the farthest corner
TANGENTIAL = 0.03  # a guess: the one real calibration at hand has 0


def folded_fraction(matrix: FloatArray, distortion: FloatArray, width: int, height: int) -> float:
    """The fraction of the pixels whose rays lie beyond the turning point of r f(r), with

        f = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).

    matrix      (3, 3) of the straightened picture
    distortion  k1 k2 p1 p2 [k3 [k4 k5 k6]]; the tangential ones count as 0
    """
    k1, k2, _, _, k3, k4, k5, k6 = np.pad(np.asarray(distortion, np.float64).ravel()[:8], (0, 8))[:8]
    x = (np.arange(width) - matrix[0, 2]) / matrix[0, 0]
    y = (np.arange(height) - matrix[1, 2]) / matrix[1, 1]
    radius = np.hypot(x, y[:, None])
    r = np.linspace(0.0, float(radius.max()), STEPS)
    above, below = np.polyval([k3, k2, k1, 1.0], r * r), np.polyval([k6, k5, k4, 1.0], r * r)
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = r * above / below
    turned = np.flatnonzero(~(np.diff(seen) > 0))
    return float((radius > r[turned[0]]).mean()) if turned.size else 0.0


def _tangential_warnings(distortion: FloatArray) -> list[str]:
    """A warning on tangential coefficients beyond `TANGENTIAL`, as radial ones are."""
    found = np.ravel(distortion)
    if found.size < 4 or np.abs(found[2:4]).max() <= TANGENTIAL:
        return []
    said = ", ".join(f"{k:g}" for k in found)
    order = ""
    if found.size == 5 and np.abs(found[3:5]).max() <= TANGENTIAL < abs(found[2]):
        order = f"; {found[0]:g} {found[1]:g} {found[3]:g} {found[4]:g} {found[2]:g} if they are k1 k2 k3 p1 p2"
    return [
        f"warning: the distortion {said} has tangential coefficients of {np.abs(found[2:4]).max():g}, as no centred"
        f" lens has; use coefficients in the order k1 k2 p1 p2 [k3 [k4 k5 k6]]{order}"
    ]


def lens_warnings(matrix: FloatArray, distortion: FloatArray, width: int, height: int) -> list[str]:
    """Warnings on large tangential coefficients, and on a lens model that turns back inside the picture."""
    folded, found = folded_fraction(matrix, distortion, width, height), _tangential_warnings(distortion)
    if folded == 0:
        return found
    said = ", ".join(f"{k:g}" for k in np.ravel(distortion))
    return [
        *found,
        f"warning: the distortion {said} turns back inside the picture: {folded:.1%} of it show parts of the source"
        " twice; use coefficients of this lens in the order k1 k2 p1 p2 [k3 [k4 k5 k6]]",
    ]
