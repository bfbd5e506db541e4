"""Families `frequencies`, `dictionary` and `atoms`: equation (1), atoms of a time and their normalisation.

Frequencies, a time and training stamps come in. The cases fix the order of sines and cosines, the factor 2 pi, the
statistics (over distinct training stamps, of the centred atom) and the dead atom, which is 0 in value and in gradient.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.clock import omegas, stamps, train_index
from endotsr.golden.vectors.making import Made, Seeds, Spec, given, scalar
from endotsr.golden.vectors.wrong import Request, WrongPort, swapped

OPERATIONS = ("frequencies", "dictionary", "atoms")


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
    """Frequencies, atoms of one time, and normalised atoms; the last case repeats stamps."""
    turns = given([1.0, 2.0, 3.0, 8.0, 16.0], "1, 2, 3, 8, 16", "cycles")
    octaves = given([1.0, 4.0, 16.0], "1, 4, 16", "cycles per sequence")
    repeated = np.arange(16) // np.array([1, 2])[np.arange(16) % 2] / 16
    return [
        *_frequencies(),
        _dictionary("generic", 0.3671875, omegas(5), "Sines first, then cosines"),
        _dictionary("quarter_turns", 0.25, turns, "Exact zeros at quarter turns"),
        _atoms("generic", stamps(21), train_index(21), omegas(3, 8.0),
               "Statistics over the training stamps only, RMS of the centred atom",
               ("statistics_over_all_frames", "rms_not_centred", "atoms_not_normalised")),
        _atoms("dead_atom", stamps(32), train_index(32), octaves,
               "sin(2 pi 16 k/32) is 0 at every stamp: the atom is dead, 0 in value and gradient",
               ("dead_atom_amplified", "rms_not_centred"), ("times", "omega")),
        _atoms("repeated_stamps", given(repeated, "k / 16 for even k, floor(k / 2) / 16 for odd k"),
               given(np.arange(16), "all", "frame"), omegas(3, 5.0), "A stamp that is repeated counts once",
               ("repeated_stamps_counted",), ("times",)),
    ]  # fmt: skip


# ---- mistakes ----


def _interleaved(request: Request) -> dict[str, NDArray]:
    phi = request.right["phi"]
    return {"phi": phi.reshape(2, -1).T.reshape(-1)}


def _normalised(
    request: Request, *, all_frames: bool = False, centred: bool = True, dead: bool = True
) -> dict[str, Any]:
    times, omega = request.inputs["times"].astype(float), request.inputs["omega"].astype(float)
    used = times if all_frames else times[request.inputs["train_index"]]
    phase = 2 * np.pi * used[:, None] * omega
    rows = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    mean = rows.mean(axis=0)
    rms = np.sqrt(((rows - (mean if centred else 0)) ** 2).mean(axis=0))
    gone = (rms < 1e-6) if dead else np.zeros(rms.shape, bool)
    gain = np.where(gone, 0.0, 1 / np.where(rms > 0, rms, 1e-300))
    phi_bar = (request.inputs["phi"] - mean) * gain
    return {"mean": mean, "rms": rms, "dead": gone, "phi_bar": phi_bar, "d_phi": request.inputs["d_phi_bar"] * gain}


def _of_the_list(request: Request) -> dict[str, Any]:
    """Statistics over the list of stamps in place of the set."""
    times = request.inputs["times"][request.inputs["train_index"]]
    phase = 2 * np.pi * np.outer(times, request.inputs["omega"])
    rows = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    rms = np.where(request.right["dead"], 0.0, rows.std(axis=0))
    gain = np.where(rms > 0, 1 / np.where(rms > 0, rms, 1.0), 0.0)
    mean = rows.mean(axis=0)
    return {"mean": mean, "rms": rms, "phi_bar": (request.inputs["phi"] - mean) * gain,
            "d_phi": request.inputs["d_phi_bar"] * gain}  # fmt: skip


WRONG_PORTS = [
    WrongPort("frequencies_linear", "Frequencies spaced linearly", "linspace; right: geomspace",
              {"frequencies": lambda r: {"omega": np.linspace(r.settings["low"], r.settings["high"],
                                                              r.settings["count"])}}),
    WrongPort("atoms_interleaved", "Sines and cosines interleaved", "[sin, cos, sin, ...]; right: all sines first",
              {"dictionary": _interleaved}),
    WrongPort("frequency_without_two_pi", "Frequency taken as angular", "sin(w t); right: sin(2 pi w t)",
              {"dictionary": swapped(lambda i: {"omega": i["omega"] / (2 * np.pi)})}),
    WrongPort("dictionary_gradient_sign", "Derivative of the cosine without its sign", "+sin; right: -sin",
              {"dictionary": lambda r: {n: r.run(dict(r.inputs) | {"d_phi": r.inputs["d_phi"] * np.repeat(
                  [1.0, -1.0], r.inputs["d_phi"].size // 2)}, r.settings)[n] for n in ("d_t", "d_omega")}}),
    WrongPort("statistics_over_all_frames", "Atom statistics over test frames too",
              "mean and RMS over all stamps; right: over the training stamps",
              {"atoms": lambda r: _normalised(r, all_frames=True),
               "scene": swapped(lambda i: {"train_index": np.arange(i["times"].size)})}),
    WrongPort("rms_not_centred", "RMS of the atom itself", "sqrt(mean phi^2); right: of phi - mean",
              {"atoms": lambda r: _normalised(r, centred=False)}),
    WrongPort("atoms_not_normalised", "Atoms centred but not divided by their RMS", "phi - mean; right: over RMS",
              {"atoms": lambda r: {"phi_bar": r.inputs["phi"] - r.right["mean"], "d_phi": r.inputs["d_phi_bar"]}}),
    WrongPort("dead_atom_amplified", "Dead atom divided by rounding noise", "1 / rms; right: 0",
              {"atoms": lambda r: _normalised(r, dead=False) if r.right["dead"].any() else None}),
    WrongPort("repeated_stamps_counted", "Repeated stamps counted more than once", "list; right: set of stamps",
              {"atoms": _of_the_list}),
]  # fmt: skip
