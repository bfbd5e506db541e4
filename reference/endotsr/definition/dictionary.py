"""Equations (1) and (1b): the Fourier dictionary, and its atoms normalised over the training stamps."""

from collections import namedtuple

import numpy as np

DictionarySaved = namedtuple("DictionarySaved", "t omega")
DictionaryGrads = namedtuple("DictionaryGrads", "d_t d_omega")
# Mean of every atom over the training stamps, RMS of the centred atom, and whether it is constant.
AtomStatistics = namedtuple("AtomStatistics", "mean rms dead")


def frequencies(count, low, high):
    """Equation (1): omega (F,), cycles per sequence, log-spaced with exact end points."""
    omega = low * (high / low) ** (np.arange(count) / max(count - 1, 1))
    omega[1:][-1:] = high
    return omega


def dictionary_forward(t, omega):
    """Equation (1): phi (2F,), all sines, then all cosines, at normalised time t.

    Quarter turns are removed first: a sine of 1e-16 instead of 0 would give C a gradient, and Adam would move it.
    """
    turns = omega * t
    quarters = np.rint(4 * turns.real)
    angle = 2 * np.pi * (turns - quarters / 4)  # (1.2)
    which = quarters.astype(np.intp) % 4  # an index has the width of a pointer
    s, c = np.sin(angle), np.cos(angle)
    sine = np.choose(which, [s, c, -s, -c])
    cosine = np.choose(which, [c, -s, -c, s])
    phi = np.concatenate([sine, cosine])
    return phi, DictionarySaved(t, omega)


def dictionary_reverse(d_phi, saved):
    """Reverse of (1): from d_phi (2F,)."""
    sine, cosine = np.split(dictionary_forward(*saved)[0], 2)
    d_sine, d_cosine = np.split(d_phi, 2)
    d_turns = 2 * np.pi * (d_sine * cosine - d_cosine * sine)  # (1.2), (1.3)
    return DictionaryGrads((d_turns * saved.omega).sum(), d_turns * saved.t)  # (1.1), (1.4)


def atom_statistics(times, omega):
    """Equation (1b): population statistics (divisor n) over the distinct training stamps `times` (n,)."""
    atoms = np.array([dictionary_forward(t, omega)[0] for t in np.unique(times)])
    mean = atoms.mean(axis=0)
    rms = np.sqrt(((atoms - mean) ** 2).mean(axis=0))
    return AtomStatistics(mean, rms, rms < 1e-6)  # ruling "atom statistics": an atom that is constant up to rounding


def normalise_forward(phi, statistics):
    """Equation (1b): phi_bar (2F,); a dead atom is 0."""
    live_rms = np.where(statistics.dead, np.inf, statistics.rms)
    return (phi - statistics.mean) / live_rms, statistics


def normalise_reverse(d_phi_bar, saved):
    """Reverse of (1b): the statistics are held fixed."""
    return d_phi_bar / np.where(saved.dead, np.inf, saved.rms)  # (1.5), (1.6)


def normalised_atoms(t, omega, statistics):
    """Equations (1) and (1b): phi_bar(t) (2F,)."""
    return normalise_forward(dictionary_forward(t, omega)[0], statistics)[0]
