"""Determinant of the projected covariance (B3) in any number of decimal digits."""

import mpmath


def determinant(position, rotation_matrix, scale, camera, low_pass, digits=60):
    """One Gaussian, no clamp: a c - b^2, and a, b, c with it (mpmath)."""
    with mpmath.workdps(digits):
        w, r = mpmath.matrix(camera.rotation.tolist()), mpmath.matrix(rotation_matrix.tolist())
        seen = w * mpmath.matrix(position.tolist()) + mpmath.matrix(camera.translation.tolist())
        x, y, z = seen[0], seen[1], seen[2]
        fx, fy = mpmath.mpf(float(camera.fx)), mpmath.mpf(float(camera.fy))
        j = mpmath.matrix([[fx / z, 0, -fx * x / z**2], [0, fy / z, -fy * y / z**2]])
        m = j * w * r * mpmath.diag([mpmath.mpf(float(s)) for s in scale])
        cov = m * m.T
        a, b, c = cov[0, 0] + mpmath.mpf(float(low_pass)), cov[0, 1], cov[1, 1] + mpmath.mpf(float(low_pass))
        return a * c - b * b, a, b, c
