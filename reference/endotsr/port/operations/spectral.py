"""Operations of the Fourier components: frequencies, atoms (1), (1b), appearance (2), motion (3), Matern prior (4)."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations import dictionary, matern
from endotsr.method.equations.appearance import appearance_forward, appearance_reverse
from endotsr.method.equations.dictionary import dictionary_forward, dictionary_reverse, frequencies
from endotsr.method.equations.motion import motion_forward, motion_reverse
from endotsr.port.operations.operation import Found, Inputs, Operation, PlainPair, Settings, Variant, split_blocks

Random = np.random.Generator

FREQUENCIES = 3  # F of the gradient checks
GAUSSIANS = 7
LENGTH = 0.2


def _each_atom(name: str) -> Mapping[str, Mapping[str, object]]:
    """One block per atom of a coefficient array."""
    return {name: {f"{name}[:, {a}]": np.s_[:, a : a + 1] for a in range(2 * FREQUENCIES)}}


# ---- equation (1) ----


def _frequencies(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    return {"omega": module.frequencies(settings["count"], settings["low"], settings["high"])}, None


def _dictionary_inputs(rng: Random) -> dict[str, NDArray]:
    return {"t": np.array(rng.uniform(0.1, 0.9)), "omega": frequencies(4, 1.0, 16.0) * rng.uniform(0.9, 1.1, 4)}


# ---- equation (1b) ----


def _over_stamps(module: Any, inputs: Inputs) -> Any:
    return module.atom_statistics(inputs["times"][inputs["train_index"]], inputs["omega"].astype(np.float64))


def _atoms(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    phi_bar, saved = module.normalise_forward(inputs["phi"], _over_stamps(module, inputs))
    return {"phi_bar": phi_bar}, saved


def _atoms_reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return {"d_phi": module.normalise_reverse(cotangents["phi_bar"], saved)}


def _statistics(module: Any, inputs: Inputs, settings: Settings, saved: Any) -> Found:
    found = _over_stamps(module, inputs)
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


def _weights(module: Any, inputs: Inputs, settings: Settings, saved: Any = None) -> Found:
    return {"rho": module.matern_weights(inputs["omega"].astype(np.float64), settings["correlation_length"])}


def _matern(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    rho = _weights(module, inputs, settings)["rho"]
    penalty, saved = module.matern_penalty_forward(inputs["motion_coefficients"], rho)
    return {"penalty": penalty}, saved


def _matern_reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return {"d_motion_coefficients": module.matern_penalty_reverse(float(cotangents["penalty"]), saved)}


def _matern_inputs(rng: Random) -> dict[str, NDArray]:
    # rho spans five decades; this scale gives all atoms equal weight, so none is lost in rounding
    rho = matern.matern_weights(frequencies(FREQUENCIES, 1.0, 16.0), LENGTH)
    scale = 0.5 / np.sqrt(np.tile(rho, 2))[:, None]
    return {"motion_coefficients": scale * rng.normal(0.0, 1.0, (3, 2 * FREQUENCIES, GAUSSIANS))}


OPERATIONS = [
    Operation(
        name="frequencies",
        equation="1",
        text="log-spaced frequencies",
        function="endotsr.method.equations.dictionary.frequencies",
        forward=partial(_frequencies, dictionary),
    ),
    PlainPair(dictionary_forward, dictionary_reverse, "t omega", "phi").operation(
        "dictionary",
        "1",
        "atoms at one time, forward and reverse",
        variants=(Variant("dictionary", _dictionary_inputs),),
    ),
    Operation(
        name="atoms",
        equation="1b",
        text="statistics over the training stamps and normalised atoms",
        function="endotsr.method.equations.dictionary.normalise_forward",
        forward=partial(_atoms, dictionary),
        reverse=partial(_atoms_reverse, dictionary),
        extra=partial(_statistics, dictionary),
        variants=(Variant("normalise", _atoms_inputs, fixed=_stamps),),
    ),
    PlainPair(appearance_forward, appearance_reverse, "appearance_coefficients phi_bar beta", "residual").operation(
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
    PlainPair(motion_forward, motion_reverse, "motion_coefficients phi", "translation").operation(
        "motion",
        "3",
        "translation residual",
        variants=(Variant("motion", _motion_inputs, blocks=split_blocks(_each_atom("motion_coefficients"))),),
    ),
    Operation(
        name="matern",
        equation="4",
        text="Matern weights and penalty",
        function="endotsr.method.equations.matern.matern_penalty_forward",
        forward=partial(_matern, matern),
        reverse=partial(_matern_reverse, matern),
        extra=partial(_weights, matern),
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
