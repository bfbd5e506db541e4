"""Equation (1): the Fourier dictionary phi(t), and (1b): its statistics over the training stamps.

In: normalised time t (dimensionless, any finite value; the training stamps are in [0, 1]) and F frequencies in cycles
per unit of normalised time. Out: 2F atoms, all sines first, then all cosines. The translation residual uses the raw
atoms phi; the colour residual uses the centred and RMS-normalised atoms phi_bar.

A dictionary is small (2F is about 16). Plain NumPy evaluates it in float64 and rounds once to the dtype of the
frequencies. This module does not depend on Gaussians or frames.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.method.kernels.arrays import FloatArray

DEAD_RMS = 1e-6  # below it, an atom is rounding noise over the stamps, which the division would amplify
WEAK_RMS = 0.05  # below it, an atom is amplified more than twentyfold; `report_atoms` lists it


class DictionarySaved(NamedTuple):
    """Frequencies and atoms, for the reverse pass."""

    t: float
    omega: FloatArray  # (F,)  float64
    sine: FloatArray  # (F,)  sin(2 pi omega t), float64
    cosine: FloatArray  # (F,)
    dtype: np.dtype


class DictionaryGrads(NamedTuple):
    """Derivative with respect to time and the frequencies."""

    d_t: float
    d_omega: FloatArray  # (F,)


class AtomStatistics(NamedTuple):
    """Mean and RMS of every atom over the training stamps, equation (1b), in float64."""

    mean: FloatArray  # (2F,)
    rms: FloatArray  # (2F,)  of the centred atom
    dead: NDArray[np.bool_]  # (2F,)  rms < DEAD_RMS: the normalised atom is 0

    @property
    def weak(self) -> NDArray[np.bool_]:
        """(2F,) live atoms that are amplified by more than 1 / WEAK_RMS."""
        return ~self.dead & (self.rms < WEAK_RMS)


class NormaliseSaved(NamedTuple):
    """Gain of every atom: 1 / rms, or 0 for a dead atom."""

    gain: FloatArray  # (2F,)  float64
    dtype: np.dtype


class AtomReport(NamedTuple):
    """How well the training stamps distinguish the atoms."""

    rank: int  # of the normalised dictionary over the stamps
    condition: float  # largest / smallest singular value inside the rank; 0 when the rank is 0
    dead: list[str]  # names of the dead atoms, "sin(2 pi 16 t)"
    weak: list[str]  # names of the weak atoms


def frequencies(count: int, low: float, high: float, dtype: DTypeLike = np.float64) -> FloatArray:
    """Log-spaced frequencies of equation (1), end points exact.

    count    F >= 1; F = 1 gives `low`
    low      lowest frequency, cycles per unit of normalised time, > 0
    high     highest frequency, >= low
    returns  (F,)  omega[0] == low and, for F > 1, omega[-1] == high to the last bit
    Raises:  ValueError for a count below 1, frequencies that are not finite and positive, or low > high.
    Oracle:  the powers 16^(k/7) in extended precision.
    """
    if count < 1:
        raise ValueError(f"count of frequencies: {count}; use an integer >= 1")
    if not (math.isfinite(high) and 0 < low <= high):
        raise ValueError(f"frequencies from {low} to {high}; use finite numbers with 0 < low <= high")
    omega = np.geomspace(low, high, count)
    omega[-1] = high if count > 1 else low
    omega[0] = low  # exp(linspace(log)) would miss 16 by an ulp
    return omega.astype(dtype)


def _sine_cosine(phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """sin(2 pi phase), cos(2 pi phase) with the phase in turns, exact at every quarter turn.

    Whole turns, then quarter turns are removed, exactly in floating point, before the multiplication by pi rounds.
    """
    turn = phase - np.rint(phase)  # [-1/2, 1/2]
    quarter = np.rint(4.0 * turn)
    angle = 2.0 * np.pi * (turn - 0.25 * quarter)  # [-pi/4, pi/4]
    sine, cosine = np.sin(angle), np.cos(angle)
    which = quarter.astype(np.intp) % 4  # np.choose refuses a wider index, and intp has 32 bits on some machines
    return (
        np.choose(which, [sine, cosine, -sine, -cosine]),
        np.choose(which, [cosine, -sine, -cosine, sine]),
    )


def dictionary_forward(t: float, omega: FloatArray) -> tuple[FloatArray, DictionarySaved]:
    """Equation (1): phi(t) = [sin(2 pi omega_f t) ..., cos(2 pi omega_f t) ...].

    t        ()    normalised time, dimensionless, any finite value
    omega    (F,)  cycles per unit of normalised time
    returns  (2F,) phi in [-1, 1], all sines then all cosines, dtype of omega; and the saved tuple
    Reverse: dictionary_reverse, below.
    Edges:   the phase is folded before the sine, so sin(2 pi 16 i/32) is exactly 0.
    Raises:  ValueError if t is not finite or omega is not one-dimensional.
    Oracle:  `endotsr.definition.dictionary`; tests/oracle/fourier_oracle.py, extended precision.
    """
    if omega.ndim != 1:
        raise ValueError(f"omega has shape {omega.shape}; expected (F,)")
    t = float(t)
    if not math.isfinite(t):
        raise ValueError(f"time {t} is not finite")
    wide = omega.astype(np.float64)
    sine, cosine = _sine_cosine(wide * t)
    phi = np.concatenate([sine, cosine]).astype(omega.dtype)
    return phi, DictionarySaved(t, wide, sine, cosine, omega.dtype)


def dictionary_reverse(d_phi: FloatArray, saved: DictionarySaved) -> DictionaryGrads:
    """Reverse of equation (1): d sin = 2 pi cos, d cos = -2 pi sin per turn of the phase omega t.

    d_phi    (2F,) derivative of the loss with respect to the atoms
    returns  derivative with respect to t (scalar) and omega (F,)
    """
    count = saved.omega.size
    d_phi = np.asarray(d_phi, np.float64)
    d_phase = 2.0 * np.pi * (d_phi[:count] * saved.cosine - d_phi[count:] * saved.sine)
    return DictionaryGrads(math.fsum(d_phase * saved.omega), (d_phase * saved.t).astype(saved.dtype))


def _atoms_over(times: FloatArray, omega: FloatArray) -> FloatArray:
    """(n, 2F) float64 atoms at every distinct stamp, in ascending order of time."""
    times = np.unique(np.asarray(times, np.float64))
    if times.size == 0 or not np.all(np.isfinite(times)):
        raise ValueError("the training stamps must be finite and at least one")
    sine, cosine = _sine_cosine(times[:, None] * omega.astype(np.float64))
    return np.concatenate([sine, cosine], axis=1)


def atom_statistics(times: FloatArray, omega: FloatArray) -> AtomStatistics:
    """Equation (1b): mean of every atom and RMS of the centred atom over the training stamps.

    times    (n,)  normalised times of the TRAINING frames only; a repeated stamp counts once
    omega    (F,)  cycles per unit of normalised time
    returns  mean, rms (2F,) in float64 and the dead atoms
    Reverse: none (constant in training).
    Edges:   one stamp -> all atoms dead. An atom that is constant over the stamps is dead.
    Raises:  ValueError if there is no stamp or a stamp is not finite.
    Oracle:  `endotsr.definition.dictionary`; tests/oracle/fourier_oracle.py
    """
    atoms = _atoms_over(times, omega)
    n = atoms.shape[0]
    mean = np.array([math.fsum(column) / n for column in atoms.T])
    rms = np.array([math.sqrt(math.fsum((column - m) ** 2) / n) for column, m in zip(atoms.T, mean)])
    return AtomStatistics(mean, rms, rms < DEAD_RMS)


def normalise_forward(phi: FloatArray, statistics: AtomStatistics) -> tuple[FloatArray, NormaliseSaved]:
    """Equation (1b): phi_bar = (phi - mean) / rms, and 0 for a dead atom.

    phi      (2F,) raw atoms
    returns  (2F,) phi_bar, mean 0 and RMS 1 over the training stamps, dtype of phi; and the saved tuple
    Reverse: normalise_reverse, below.
    Edges:   a dead atom is 0 in value and gradient.
    Oracle:  `endotsr.definition.dictionary`; tests/oracle/fourier_oracle.py
    """
    if phi.shape != statistics.mean.shape:
        raise ValueError(f"phi has shape {phi.shape}; the statistics are of {statistics.mean.shape}")
    gain = np.where(statistics.dead, 0.0, 1.0 / np.where(statistics.dead, 1.0, statistics.rms))
    phi_bar = (phi.astype(np.float64) - statistics.mean) * gain
    return phi_bar.astype(phi.dtype), NormaliseSaved(gain, phi.dtype)


def normalise_reverse(d_phi_bar: FloatArray, saved: NormaliseSaved) -> FloatArray:
    """Reverse of (1b): the same gain; the statistics are held fixed. (2F,) -> (2F,)"""
    return (np.asarray(d_phi_bar, np.float64) * saved.gain).astype(saved.dtype)


def normalised_atoms(t: float, omega: FloatArray, statistics: AtomStatistics) -> FloatArray:
    """phi_bar(t): equations (1) and (1b) in one call, rounded once. Shape (2F,), dtype of omega."""
    phi, _ = dictionary_forward(t, omega.astype(np.float64))
    phi_bar, _ = normalise_forward(phi, statistics)
    return phi_bar.astype(omega.dtype)


def report_atoms(times: FloatArray, omega: FloatArray) -> AtomReport:
    """Rank and condition of the normalised dictionary over the training stamps, and its dead and weak atoms.

    If the rank is below 2F, the stamps do not determine all coefficients. There are too few frames, for example, or
    their spacing aliases one frequency to another or to a constant.
    """
    statistics = atom_statistics(times, omega)
    gain = np.where(statistics.dead, 0.0, 1.0 / np.where(statistics.dead, 1.0, statistics.rms))
    atoms = (_atoms_over(times, omega) - statistics.mean) * gain
    singular = np.linalg.svd(atoms, compute_uv=False)
    rank = int(np.sum(singular > singular[0] * max(atoms.shape) * np.finfo(np.float64).eps))
    condition = float(singular[0] / singular[rank - 1]) if rank else 0.0
    names = [f"{wave}(2 pi {f:.4g} t)" for wave in ("sin", "cos") for f in omega]
    dead = [name for name, flag in zip(names, statistics.dead) if flag]
    return AtomReport(rank, condition, dead, [name for name, flag in zip(names, statistics.weak) if flag])
