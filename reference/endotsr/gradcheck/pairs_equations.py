"""The forward/reverse pairs of the paper's equations, for gradient checks and golden cases."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.appearance import appearance_forward, appearance_reverse
from endotsr.equations.dictionary import (
    atom_statistics,
    dictionary_forward,
    dictionary_reverse,
    frequencies,
    normalise_forward,
    normalise_reverse,
)
from endotsr.equations.laplacian import (
    SupportMasks,
    laplacian_levels,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    support_masks,
)
from endotsr.equations.matern import matern_penalty_forward, matern_penalty_reverse, matern_weights
from endotsr.equations.motion import motion_forward, motion_reverse
from endotsr.equations.pyramid import Upsampling
from endotsr.gradcheck.registry import Arrays, Pair

Random = np.random.Generator

FREQUENCIES = 3  # F of the small cases
GAUSSIANS = 7
BETA = 0.3
LENGTH = 0.2
IMAGE_SHAPE = (3, 19, 22)  # odd and even; sizes 19x22, 10x11, 5x6, 3x3


# ---- equation (1) ----


def _dictionary_inputs(rng: Random) -> dict[str, NDArray]:
    return {"t": np.array(rng.uniform(0.1, 0.9)), "omega": frequencies(4, 1.0, 16.0) * rng.uniform(0.9, 1.1, 4)}


def _dictionary_forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"phi": dictionary_forward(float(inputs["t"]), inputs["omega"])[0]}


def _dictionary_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    grads = dictionary_reverse(cotangents["phi"], dictionary_forward(float(inputs["t"]), inputs["omega"])[1])
    return {"t": np.array(grads.t), "omega": grads.omega}


# ---- equation (1b) ----

_STATISTICS = atom_statistics(np.arange(21) / 24.0, frequencies(FREQUENCIES, 1.0, 12.0))  # sin(2 pi 12 t) is dead


def _normalise_inputs(rng: Random) -> dict[str, NDArray]:
    return {"phi": rng.uniform(-1.0, 1.0, 2 * FREQUENCIES)}


def _normalise_forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"phi_bar": normalise_forward(inputs["phi"], _STATISTICS)[0]}


def _normalise_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    return {"phi": normalise_reverse(cotangents["phi_bar"], normalise_forward(inputs["phi"], _STATISTICS)[1])}


# ---- equation (2) ----


def _appearance_inputs(rng: Random) -> dict[str, NDArray]:
    return {
        "appearance_coefficients": rng.normal(0.0, 0.4, (3, 2 * FREQUENCIES, GAUSSIANS)),
        "phi_bar": rng.normal(0.0, 1.0, 2 * FREQUENCIES),
    }


def _appearance_forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"residual": appearance_forward(inputs["appearance_coefficients"], inputs["phi_bar"], BETA)[0]}


def _appearance_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = appearance_forward(inputs["appearance_coefficients"], inputs["phi_bar"], BETA)
    return appearance_reverse(cotangents["residual"], saved)._asdict()


# ---- equation (3) ----


def _motion_inputs(rng: Random) -> dict[str, NDArray]:
    return {
        "motion_coefficients": rng.normal(0.0, 0.5, (3, 2 * FREQUENCIES, GAUSSIANS)),
        "phi": rng.uniform(-1.0, 1.0, 2 * FREQUENCIES),
    }


def _motion_forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"translation": motion_forward(inputs["motion_coefficients"], inputs["phi"])[0]}


def _motion_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = motion_forward(inputs["motion_coefficients"], inputs["phi"])
    return motion_reverse(cotangents["translation"], saved)._asdict()


def _one_block_an_atom(name: str) -> Callable[[Arrays], dict[str, tuple[str, object]]]:
    """One block an atom of a coefficient array, and one for every other input."""

    def blocks(inputs: Arrays) -> dict[str, tuple[str, object]]:
        found: dict[str, tuple[str, object]] = {}
        for a in range(inputs[name].shape[1]):
            found[f"{name}[:, {a}]"] = (name, np.s_[:, a : a + 1])
        for other in inputs:
            if other != name:
                found[other] = (other, np.s_[...])
        return found

    return blocks


# ---- equation (4) ----

_RHO = matern_weights(frequencies(FREQUENCIES, 1.0, 16.0), LENGTH)


def _penalty_inputs(rng: Random) -> dict[str, NDArray]:
    # rho spans five decades; this scale gives every atom an equal share, so that none hides in the rounding of another
    scale = 0.5 / np.sqrt(np.tile(_RHO, 2))[:, None]
    return {"motion_coefficients": scale * rng.normal(0.0, 1.0, (3, 2 * FREQUENCIES, GAUSSIANS))}


def _penalty_forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"penalty": np.array(matern_penalty_forward(inputs["motion_coefficients"], _RHO)[0])}


def _penalty_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = matern_penalty_forward(inputs["motion_coefficients"], _RHO)
    return {"motion_coefficients": matern_penalty_reverse(float(cotangents["penalty"]), saved)}


# ---- equation (5) ----


def observed_image(shape: tuple[int, int, int] = IMAGE_SHAPE) -> NDArray[np.float64]:
    """The constant observed image of the Laplacian cases, from a closed formula."""
    c, y, x = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    return 0.5 + 0.3 * np.sin(0.9 * x + 0.4 * c) * np.cos(0.7 * y)


def tissue_mask(shape: tuple[int, int] = IMAGE_SHAPE[1:]) -> NDArray[np.bool_]:
    """Its mask: an instrument in the lower right corner, small enough that every level keeps valid pixels."""
    y, x = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    return (y < shape[0] - 2) | (x < shape[1] - 3)


def _kink_distance(rendered: NDArray, masks: SupportMasks) -> float:
    bands = laplacian_levels(rendered - observed_image(), len(masks.bands), masks.upsampling).bands
    return min(float(np.abs(band[:, valid]).min()) for band, valid in zip(bands, masks.bands))


def _laplacian_pair(upsampling: Upsampling) -> Pair:
    masks = support_masks(tissue_mask(), upsampling=upsampling)

    def inputs(rng: Random) -> dict[str, NDArray]:
        # Of 16 draws the one whose valid band differences stay furthest from the kink of |.|
        draws = [observed_image() + rng.normal(0.0, 0.3, IMAGE_SHAPE) for _ in range(16)]
        return {"rendered": max(draws, key=lambda rendered: _kink_distance(rendered, masks))}

    def forward(arrays: Arrays) -> dict[str, NDArray]:
        return {"loss": np.array(laplacian_loss_forward(arrays["rendered"], observed_image(), masks, upsampling)[0])}

    def reverse(arrays: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        _, saved = laplacian_loss_forward(arrays["rendered"], observed_image(), masks, upsampling)
        return {"rendered": laplacian_loss_reverse(float(cotangents["loss"]), saved)}

    def blocks(_: Arrays) -> dict[str, tuple[str, object]]:
        return {f"rendered[{c}]": ("rendered", np.s_[c : c + 1]) for c in range(IMAGE_SHAPE[0])}

    def trace(arrays: Arrays) -> dict[str, NDArray]:
        _, saved = laplacian_loss_forward(arrays["rendered"], observed_image(), masks, upsampling)
        return {f"signs_{level + 1}": sign for level, sign in enumerate(saved.signs)}

    name = f"laplacian_loss_{upsampling}"
    function = "endotsr.equations.laplacian.laplacian_loss_forward"
    return Pair(name, "5", function, inputs, forward, reverse, blocks, trace)


def _pair(
    name: str,
    equation: str,
    module: str,
    functions: tuple[Callable, Callable, Callable],
    blocks: Callable[[Arrays], dict[str, tuple[str, object]]] | None = None,
) -> Pair:
    return Pair(name, equation, f"endotsr.equations.{module}.{name}_forward", *functions, blocks)


PAIRS: list[Pair] = [
    _pair("dictionary", "1", "fourier", (_dictionary_inputs, _dictionary_forward, _dictionary_reverse)),
    _pair("normalise", "1b", "fourier", (_normalise_inputs, _normalise_forward, _normalise_reverse)),
    _pair(
        "appearance",
        "2",
        "appearance",
        (_appearance_inputs, _appearance_forward, _appearance_reverse),
        _one_block_an_atom("appearance_coefficients"),
    ),
    _pair(
        "motion",
        "3",
        "motion",
        (_motion_inputs, _motion_forward, _motion_reverse),
        _one_block_an_atom("motion_coefficients"),
    ),
    _pair(
        "matern_penalty",
        "4",
        "matern",
        (_penalty_inputs, _penalty_forward, _penalty_reverse),
        _one_block_an_atom("motion_coefficients"),
    ),
    _laplacian_pair("co_sited"),
    _laplacian_pair("half_pixel"),
]
