"""Equations (1) and (1b) with fifty digits."""

import mpmath


def frequencies(count, low, high):
    with mpmath.workdps(50):
        if count == 1:
            return [mpmath.mpf(low)]
        ratio = mpmath.mpf(high) / mpmath.mpf(low)
        return [low * ratio ** (mpmath.mpf(k) / (count - 1)) for k in range(count)]


def dictionary(t, omega):
    with mpmath.workdps(50):
        turns = [2 * mpmath.mpf(float(w)) * mpmath.mpf(float(t)) for w in omega]
        return [mpmath.sinpi(p) for p in turns] + [mpmath.cospi(p) for p in turns]


def normalised(times, omega, t):
    """phi_bar(t) as floats, None for an atom whose RMS over `times` is below 1e-6."""
    with mpmath.workdps(50):
        rows = [dictionary(s, omega) for s in times]
        found = []
        for a, value in enumerate(dictionary(t, omega)):
            column = [row[a] for row in rows]
            mean = mpmath.fsum(column) / len(column)
            rms = mpmath.sqrt(mpmath.fsum((v - mean) ** 2 for v in column) / len(column))
            found.append(None if rms < 1e-6 else float((value - mean) / rms))
        return found
