"""Stages of the Fourier components: frequencies and atoms (1), (1b), appearance (2), motion (3), Matern prior (4)."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.appearance import appearance_forward, appearance_reverse
from endotsr.equations.dictionary import (
    NormaliseSaved,
    dictionary_forward,
    dictionary_reverse,
    frequencies,
    normalise_forward,
    normalise_reverse,
)
from endotsr.equations.matern import MaternSaved, matern_penalty_forward, matern_penalty_reverse, matern_weights
from endotsr.equations.motion import motion_forward, motion_reverse
from endotsr.stages.requests import statistics_of
from endotsr.stages.stage import Found, Inputs, PlainPair, Settings, Stage, Variant, split_blocks

Random = np.random.Generator

FREQUENCIES = 3  # F of the gradient checks
GAUSSIANS = 7
LENGTH = 0.2


def _each_atom(name: str) -> Mapping[str, Mapping[str, object]]:
    """One block an atom of a coefficient array."""
    return {name: {f"{name}[:, {a}]": np.s_[:, a : a + 1] for a in range(2 * FREQUENCIES)}}


# ---- equation (1) ----


def _frequencies(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    return {"omega": frequencies(settings["count"], settings["low"], settings["high"])}, None


def _dictionary_inputs(rng: Random) -> dict[str, NDArray]:
    return {"t": np.array(rng.uniform(0.1, 0.9)), "omega": frequencies(4, 1.0, 16.0) * rng.uniform(0.9, 1.1, 4)}


# ---- equation (1b) ----


def _atoms(inputs: Inputs, settings: Settings) -> tuple[Found, NormaliseSaved]:
    phi_bar, saved = normalise_forward(inputs["phi"], statistics_of(inputs))
    return {"phi_bar": phi_bar}, saved


def _atoms_reverse(cotangents: Inputs, saved: NormaliseSaved) -> Found:
    return {"d_phi": normalise_reverse(cotangents["phi_bar"], saved)}


def _statistics(inputs: Inputs, settings: Settings, saved: NormaliseSaved) -> Found:
    found = statistics_of(inputs)
    return {"mean": found.mean, "rms": np.where(found.dead, 0.0, found.rms), "dead": found.dead}


def _atoms_inputs(rng: Random) -> dict[str, NDArray]:
    return {"phi": rng.uniform(-1.0, 1.0, 2 * FREQUENCIES)}


def _stamps(dtype: np.dtype) -> dict[str, NDArray]:
    """Stamps at which one atom, sin(2 pi 12 t), is dead."""
    omega = frequencies(FREQUENCIES, 1.0, 12.0)
    return {"times": np.arange(21) / 24.0, "train_index": np.arange(21), "omega": omega}


# ---- equation (2) ----


def _appearance_inputs(rng: Random) -> dict[str, NDArray]:
    return {
        "appearance_coefficients": rng.normal(0.0, 0.4, (3, 2 * FREQUENCIES, GAUSSIANS)),
        "phi_bar": rng.normal(0.0, 1.0, 2 * FREQUENCIES),
    }


# ---- equation (3) ----


def _motion_inputs(rng: Random) -> dict[str, NDArray]:
    return {
        "motion_coefficients": rng.normal(0.0, 0.5, (3, 2 * FREQUENCIES, GAUSSIANS)),
        "phi": rng.uniform(-1.0, 1.0, 2 * FREQUENCIES),
    }


# ---- equation (4) ----


def _weights(inputs: Inputs, settings: Settings) -> NDArray:
    return matern_weights(inputs["omega"].astype(np.float64), settings["correlation_length"])


def _matern(inputs: Inputs, settings: Settings) -> tuple[Found, MaternSaved]:
    penalty, saved = matern_penalty_forward(inputs["motion_coefficients"], _weights(inputs, settings))
    return {"penalty": penalty}, saved


def _matern_reverse(cotangents: Inputs, saved: MaternSaved) -> Found:
    return {"d_motion_coefficients": matern_penalty_reverse(float(cotangents["penalty"]), saved)}


def _matern_inputs(rng: Random) -> dict[str, NDArray]:
    # rho spans five decades; this scale gives all atoms equal weight, so that none is lost in the rounding of another
    rho = matern_weights(frequencies(FREQUENCIES, 1.0, 16.0), LENGTH)
    scale = 0.5 / np.sqrt(np.tile(rho, 2))[:, None]
    return {"motion_coefficients": scale * rng.normal(0.0, 1.0, (3, 2 * FREQUENCIES, GAUSSIANS))}


STAGES = [
    Stage(
        name="frequencies",
        equation="1",
        text="log-spaced frequencies",
        function="endotsr.equations.dictionary.frequencies",
        forward=_frequencies,
    ),
    PlainPair(dictionary_forward, dictionary_reverse, "t omega", "phi").stage(
        "dictionary",
        "1",
        "atoms at one time, forward and reverse",
        variants=(Variant("dictionary", _dictionary_inputs),),
    ),
    Stage(
        name="atoms",
        equation="1b",
        text="statistics over the training stamps and normalised atoms",
        function="endotsr.equations.dictionary.normalise_forward",
        forward=_atoms,
        reverse=_atoms_reverse,
        extra=_statistics,
        variants=(Variant("normalise", _atoms_inputs, fixed=_stamps),),
    ),
    PlainPair(appearance_forward, appearance_reverse, "appearance_coefficients phi_bar beta", "residual").stage(
        "appearance",
        "2",
        "bounded colour residual",
        variants=(
            Variant(
                "appearance",
                _appearance_inputs,
                {"beta": 0.3},
                blocks=split_blocks(_each_atom("appearance_coefficients")),
            ),
        ),
    ),
    PlainPair(motion_forward, motion_reverse, "motion_coefficients phi", "translation").stage(
        "motion",
        "3",
        "translation residual",
        variants=(Variant("motion", _motion_inputs, blocks=split_blocks(_each_atom("motion_coefficients"))),),
    ),
    Stage(
        name="matern",
        equation="4",
        text="Matern weights and penalty",
        function="endotsr.equations.matern.matern_penalty_forward",
        forward=_matern,
        reverse=_matern_reverse,
        extra=lambda inputs, settings, saved: {"rho": _weights(inputs, settings)},
        variants=(
            Variant(
                "matern_penalty",
                _matern_inputs,
                settings={"correlation_length": LENGTH},
                fixed=lambda dtype: {"omega": frequencies(FREQUENCIES, 1.0, 16.0)},
                blocks=split_blocks(_each_atom("motion_coefficients")),
            ),
        ),
    ),
]
