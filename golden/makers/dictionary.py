"""Families `frequencies`, `dictionary` and `atoms`: equation (1), atoms of a time and their normalisation.

Inputs: frequencies, a time and training stamps. The cases test the order of sines and cosines, the factor 2 pi, the
statistics (over distinct training stamps, of the centred atom) and the dead atom, which is 0 in value and in gradient.
"""

import numpy as np

from makers.clock import omegas, stamps, train_index
from makers.making import Made, Seeds, Spec, given, scalar
from makers.operations import Declared, Judged

DECLARED = {
    "frequencies": Declared(
        {"omega": Judged(1, "cycles per sequence", oracle="fourier_oracle.frequencies")},
        "`count` log-spaced values from `low` to `high`",
        settings={"count": "model.frequencies", "low": "model.frequency_min", "high": "model.frequency_max"},
    ),
    "dictionary": Declared(
        {
            "phi": Judged(1, oracle="fourier_oracle.dictionary"),
            "d_t": Judged(2, "loss"),
            "d_omega": Judged(2, "loss per cycle"),
        },
        "atoms at `t`, derivatives by `t` and `omega`",
    ),
    "atoms": Declared(
        {
            "mean": Judged(1),
            "rms": Judged(1),
            "dead": Judged(1, scale="exact"),
            "phi_bar": Judged(1, oracle="fourier_oracle.normalised"),
            "d_phi": Judged(2, "loss"),
        },
        "statistics over `times[train_index]`; `rms` is 0 where `dead`; `phi_bar` from the given `phi`",
    ),
}
OPERATIONS = tuple(DECLARED)


def _frequencies() -> list[Spec]:
    return [
        Spec("frequencies", "published", "frequencies", "Eight log-spaced frequencies with exact ends",
             ("frequencies_linear",), {"count": 8, "low": 1.0, "high": 16.0}, {}),
        Spec("frequencies", "one", "frequencies", "One frequency is the lowest", (),
             {"count": 1, "low": 2.0, "high": 16.0}, {}),
    ]  # fmt: skip


def _dictionary(case: str, t: float, omega: Made, title: str) -> Spec:
    inputs = {"t": scalar(t), "omega": omega, "d_phi": Seeds("dictionary", case).uniform("d_phi", -1.0, 1.0, 10)}
    flags = ("atoms_interleaved", "frequency_without_two_pi", "dictionary_gradient_sign")
    return Spec("dictionary", case, "dictionary", title, flags, {}, inputs)


def _atoms(
    case: str, times: Made, train: Made, omega: Made, title: str, flags: tuple[str, ...], still: tuple[str, ...] = ()
) -> Spec:
    seeds = Seeds("atoms", case)
    inputs = {
        "times": times,
        "train_index": train,
        "omega": omega,
        "phi": seeds.uniform("phi", -1.0, 1.0, 6),
        "d_phi_bar": seeds.uniform("d_phi_bar", -1.0, 1.0, 6),
    }
    return Spec("atoms", case, "atoms", title, flags, {}, inputs, still)


def cases() -> list[Spec]:
    """Frequencies, atoms of one time, and normalised atoms; the last cases repeat stamps and have a slow atom."""
    turns = given([1.0, 2.0, 3.0, 8.0, 16.0], "1, 2, 3, 8, 16", "cycles")
    octaves = given([1.0, 4.0, 16.0], "1, 4, 16", "cycles per sequence")
    repeated = np.arange(16) // np.array([1, 2])[np.arange(16) % 2] / 16
    return [
        *_frequencies(),
        _dictionary("generic", 0.3671875, omegas(5), "Sines first, then cosines"),
        _dictionary("quarter_turns", 0.25, turns, "Exact zeros at quarter turns"),
        _atoms("generic", stamps(21), train_index(21), omegas(3, 8.0),
               "Statistics over the training stamps only, RMS of the centred atom",
               ("statistics_over_all_frames", "rms_not_centred", "atoms_not_normalised",
                "atoms_not_centred")),
        _atoms("dead_atom", stamps(32), train_index(32), octaves,
               "sin(2 pi 16 k/32) is 0 at every stamp: the atom is dead, 0 in value and gradient",
               ("dead_atom_amplified", "rms_not_centred"), ("times", "omega")),
        _atoms("repeated_stamps", given(repeated, "k / 16 for even k, floor(k / 2) / 16 for odd k"),
               given(np.arange(16), "all", "frame"), omegas(3, 5.0), "A stamp that is repeated counts once",
               ("repeated_stamps_counted",), ("times",)),
        _atoms("slow_atom", stamps(24), train_index(24),
               given([2.0**-13, 0.5, 4.0], "2^-13, 1/2, 4", "cycles per sequence"),
               "A sine with an RMS of 2e-4 is alive, the cosine beside it is dead", ()),
    ]  # fmt: skip
