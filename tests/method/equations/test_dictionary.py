"""Equations (1) and (1b): the dictionary, its statistics and its hard cases W1 to W6."""

import dataclasses

import numpy as np
import pytest

from endotsr.config import Config
from endotsr.definition import dictionary as definition
from endotsr.method.equations import dictionary
from endotsr.method.equations.dictionary import (
    AtomStatistics,
    atom_statistics,
    dictionary_forward,
    dictionary_reverse,
    frequencies,
    normalise_forward,
    normalise_reverse,
    normalised_atoms,
    report_atoms,
)
from endotsr.training.fitting.state import training_constants
from endotsr.training.scene import workload
from oracle import fourier_oracle

U = np.finfo(np.float64).eps / 2


def training_stamps(n):
    index = np.arange(n)
    return index[(index - 1) % 8 != 0] / n


def atoms_at(times, omega):
    return np.stack([dictionary_forward(t, omega)[0] for t in times])


@pytest.mark.parametrize("t", [0.0, 1 / 3, 0.123456789, 0.999, -2.25, 7.7])
def test_dictionary_against_oracle(t):
    omega = frequencies(8, 1.0, 16.0)
    phi, _ = dictionary_forward(t, omega)
    expected = np.array([float(v) for v in fourier_oracle.dictionary(t, omega)])
    # one rounding of the product omega t is amplified by 2 pi
    assert np.all(np.abs(phi - expected) <= 2 * U + 2 * np.pi * U * np.tile(np.abs(omega * t), 2))


def test_float32_is_the_rounded_float64():
    omega = frequencies(8, 1.0, 16.0, np.float32)
    phi, _ = dictionary_forward(0.37, omega)
    wide, _ = dictionary_forward(0.37, omega.astype(np.float64))
    assert phi.dtype == np.float32
    assert np.array_equal(phi, wide.astype(np.float32))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_hard_W1_phase_is_folded_before_the_sine(dtype):
    omega = np.array([16.0], dtype)
    for i in range(32):
        phi, _ = dictionary_forward(i / 32, omega)
        assert phi[0] == 0.0
        assert phi[1] == (-1.0) ** i
    quarter, _ = dictionary_forward(0.25, np.array([1.0, 3.0], dtype))
    assert quarter.tolist() == [1.0, -1.0, 0.0, 0.0]


def test_hard_W1_dead_atom_is_zero_in_value_and_gradient():
    omega = np.array([1.0, 16.0])
    statistics = atom_statistics(np.arange(32) / 32, omega)
    assert statistics.dead.tolist() == [False, True, False, False]
    phi_bar, saved = normalise_forward(dictionary_forward(0.013, omega)[0], statistics)
    gradient = normalise_reverse(np.ones(4), saved)
    assert phi_bar[1] == 0.0 and gradient[1] == 0.0
    assert np.all(phi_bar[[0, 2, 3]] != 0) and np.all(gradient[[0, 2, 3]] > 0)


def test_hard_W1_weak_atom_is_flagged():
    statistics = AtomStatistics(np.zeros(3), np.array([0.04, 0.06, 1e-9]), np.array([False, False, True]))
    assert statistics.weak.tolist() == [True, False, False]
    report = report_atoms(np.arange(32) / 32, np.array([16.0]))
    assert report.dead == ["sin(2 pi 16 t)"] and report.weak == []


def test_hard_W1_a_dead_atom_adds_nothing_to_the_rank():
    """Stamps a hair off the zeros of the sine: its RMS is 1e-7, small but far above rounding."""
    stamps = np.arange(8) / 16 + 1e-9 * np.arange(8)
    report = report_atoms(stamps, np.array([16.0]))
    assert report.dead == ["sin(2 pi 16 t)", "cos(2 pi 16 t)"]
    assert (report.rank, report.condition) == (0, 0.0)


def test_rank_and_condition_are_those_of_the_normalised_atoms():
    """Stamps on an eighth of the clip: the atoms have unequal RMS, and only the normalised ones have this condition."""
    omega, times = np.array([0.5, 1.0, 2.0]), np.linspace(0, 0.3, 11)
    atoms = atoms_at(times, omega)
    atoms = atoms - atoms.mean(axis=0)
    rms = np.sqrt((atoms**2).mean(axis=0))
    assert rms.max() > 5 * rms.min()
    report = report_atoms(times, omega)
    assert report.rank == 6
    assert report.condition == pytest.approx(np.linalg.cond(atoms / rms), rel=1e-6)


def test_the_condition_is_that_of_the_atoms_that_are_not_dead():
    report = report_atoms(np.arange(16) / 16, np.array([1.0, 8.0]))
    assert report.dead == ["sin(2 pi 8 t)"]
    assert report.rank == 3 and report.condition == pytest.approx(1.0)


def test_frequencies_that_differ_by_rounding_count_once():
    """Their difference is 1e-13 of an atom: more than one rounding, less than those of a thousand stamps."""
    report = report_atoms(np.linspace(0, 1, 1000), np.array([1.0, 1.0 + 3e-14]))
    assert report.rank == 2


def test_hard_W2_one_stamp_makes_every_atom_dead():
    omega = frequencies(8, 1.0, 16.0)
    for times in ([0.3], [0.3, 0.3, 0.3]):
        statistics = atom_statistics(times, omega)
        assert statistics.dead.all()
        assert np.array_equal(normalised_atoms(0.7, omega, statistics), np.zeros(16))
    assert report_atoms([0.3], omega)[:2] == (0, 0.0)
    assert report_atoms([0.1, 0.35], omega).rank == 1


@pytest.mark.parametrize(("n", "rank"), [(16, 13), (32, 15), (33, 16), (63, 16), (156, 16)])
def test_hard_W3_rank_of_the_published_sequence_lengths(n, rank):
    report = report_atoms(training_stamps(n), frequencies(8, 1.0, 16.0))
    assert report.rank == rank
    if n in (63, 156):
        assert 8 < report.condition < 12


def test_hard_W3_the_rank_is_full_from_20_frames_on_except_for_32():
    ranks = {n: report_atoms(training_stamps(n), frequencies(8, 1.0, 16.0)).rank for n in range(14, 201)}
    assert [n for n in ranks if ranks[n] < 16] == [14, 15, 16, 17, 18, 19, 32]


def test_hard_W3_more_cycles_than_half_the_frames_are_no_equal_atoms():
    """24 frames, 16 cycles: no two atoms agree at the stamps, and the rank is full."""
    times, omega = np.arange(24) / 24, frequencies(8, 1.0, 16.0)
    report, statistics = report_atoms(times, omega), atom_statistics(times, omega)
    atoms = np.array([normalised_atoms(t, omega, statistics) for t in times])
    agreement = np.abs(atoms.T @ atoms / len(times) - np.eye(16)).max()  # 1 = equal, or opposite
    assert omega[-1] > len(times) / 2 and report.rank == 16 and agreement < 0.9


@pytest.mark.parametrize("n", [9, 63, 156])
def test_hard_W4_float32_atoms_are_the_rounded_float64_ones(n):
    times, omega = training_stamps(n), frequencies(8, 1.0, 16.0, np.float32)
    narrow, wide = atom_statistics(times, omega), atom_statistics(times, omega.astype(np.float64))
    for t in times[:5]:
        found, truth = normalised_atoms(t, omega, narrow), normalised_atoms(t, omega.astype(np.float64), wide)
        assert found.dtype == np.float32 and np.abs(found - truth).max() <= 8 * 2.0**-24


def test_hard_W4_statistics_do_not_read_the_test_stamps():
    """A run on a sequence whose held-out stamps are moved has the same atoms, bit by bit."""
    config, atoms = Config(), []
    for shift in (0.0, 0.3):
        sequence = workload.sequence(32, 24)
        moved = sequence.times.copy()
        moved[sequence.test_index] += shift
        spectral = training_constants(dataclasses.replace(sequence, times=moved), config).spectral
        atoms.append(normalised_atoms(0.77, spectral.omega, spectral.statistics).tobytes())
    assert atoms[0] == atoms[1]


@pytest.mark.parametrize("n", [9, 63, 156])
def test_hard_W4_mean_zero_and_rms_one_over_the_training_stamps(n):
    times, omega = training_stamps(n), frequencies(8, 1.0, 16.0)
    statistics = atom_statistics(times, omega)
    bars = np.stack([normalised_atoms(t, omega, statistics) for t in times])
    live = ~statistics.dead
    assert np.all(np.abs(bars.mean(axis=0)) <= 1e-15)
    assert np.all(np.abs(np.sqrt((bars[:, live] ** 2).mean(axis=0)) - 1) <= 1e-14)


def test_normalised_atoms_against_oracle():
    times, omega = training_stamps(32), frequencies(8, 1.0, 16.0)
    statistics = atom_statistics(times, omega)
    expected = fourier_oracle.normalised(times, omega, 0.4)
    for found, value in zip(normalised_atoms(0.4, omega, statistics), expected):
        assert found == (0.0 if value is None else pytest.approx(value, rel=1e-13, abs=1e-14))


def test_hard_W5_end_points_are_exact():
    omega = frequencies(8, 1.0, 16.0)
    assert omega[0] == 1.0 and omega[-1] == 16.0
    expected = [float(v) for v in fourier_oracle.frequencies(8, 1, 16)]
    np.testing.assert_allclose(omega, expected, rtol=4e-16)
    assert frequencies(1, 1.0, 16.0).tolist() == [1.0]
    assert frequencies(3, 0.7, 0.7).tolist() == [0.7] * 3
    third = frequencies(4, 1 / 3, 7.7)
    assert third[0] == 1 / 3 and third[-1] == 7.7


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_hard_W6_stamps_outside_the_unit_interval(dtype):
    omega = frequencies(8, 1.0, 16.0, dtype)
    statistics = atom_statistics(training_stamps(63), omega)
    for t in (-1.0, 2.0, 1e6):
        assert np.all(np.isfinite(normalised_atoms(t, omega, statistics)))
        phi, saved = dictionary_forward(t, omega)
        grads = dictionary_reverse(np.ones_like(phi), saved)
        assert np.isfinite(phi).all() and np.isfinite(grads.d_t) and np.isfinite(grads.d_omega).all()
    assert not np.allclose(dictionary_forward(0.2, omega)[0], dictionary_forward(1.2, omega)[0])


@pytest.mark.parametrize("arguments", [(0, 1, 16), (8, 0, 16), (8, -1, 16), (8, 16, 1), (8, 1, np.inf), (8, np.nan, 2)])
def test_refused_frequencies(arguments):
    with pytest.raises(ValueError, match=r"use (finite numbers|an integer)"):
        frequencies(*arguments)


def test_refused_times():
    omega = frequencies(2, 1.0, 16.0)
    for times in ([], [0.1, np.nan]):
        with pytest.raises(ValueError, match="stamps"):
            atom_statistics(times, omega)
    with pytest.raises(ValueError, match="finite"):
        dictionary_forward(np.inf, omega)
    with pytest.raises(ValueError, match="shape"):
        dictionary_forward(0.1, omega[None])
    with pytest.raises(ValueError, match="statistics"):
        normalise_forward(np.zeros(3), atom_statistics([0.1], omega))


class Narrow:
    """NumPy of a machine with indices of 32 bits: `choose` refuses wider ones."""

    intp = np.int32

    def __getattr__(self, name):
        return getattr(np, name)

    @staticmethod
    def choose(which, choices):
        assert which.dtype == np.int32, f"Cannot cast from {which.dtype} to int32"
        return np.choose(which, choices)


@pytest.mark.parametrize("module", [dictionary, definition], ids=["compiled", "definition"])
def test_atoms_need_no_index_wider_than_a_pointer(module, monkeypatch):
    omega = frequencies(8, 1.0, 16.0)
    expected, _ = module.dictionary_forward(5 / 32, omega)
    monkeypatch.setattr(module, "np", Narrow())
    np.testing.assert_array_equal(module.dictionary_forward(5 / 32, omega)[0], expected)
