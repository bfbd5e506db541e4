"""Family `reading`: how arrays, masks and pixels are addressed, and the generator of words.

A port echoes parts of its inputs. The cases are those of level 0: a port that misreads the axes, the mask or the
pixel centres is refused here, before its equations are judged.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.judge.words import GAMMA, MIX_1, MIX_2, fnv1a
from endotsr.golden.vectors.making import Spec, given, scalar
from endotsr.golden.vectors.wrong import Request, WrongPort, output

OPERATIONS = ("reading", "generator")


def _layout() -> Spec:
    k, c, n = np.meshgrid(np.arange(4), np.arange(3), np.arange(5), indexing="ij")
    y, x = np.meshgrid(np.arange(3), np.arange(4), indexing="ij")
    inputs = {
        "harmonics": given((100.0 * k + 10.0 * c + n) / 8, "(100 k + 10 c + n) / 8 at [k, c, n]"),
        "mask": given((x + 2 * y) % 3 != 0, "(x + 2 y) % 3 != 0"),
        "scalar": scalar(-2.5),
        "empty": given(np.zeros((3, 0)), "no Gaussian"),
    }
    flags = ("fortran_order", "gaussian_first", "mask_inverted", "pixel_corner")
    return Spec("reading", "layout", "reading", "The Gaussian index is the last axis, C order, True is tissue",
                flags, {"gaussian": 3, "row": 1}, inputs)  # fmt: skip


def cases() -> list[Spec]:
    """The layout of arrays, and the written-out generator."""
    return [
        _layout(),
        Spec("reading", "generator", "generator", "Words of splitmix64 from the FNV-1a hash of a text",
             ("signed_shift",), {"seed": "reading/generator/words", "count": 12}, {}),
    ]  # fmt: skip


# ---- mistakes ----


def _signed_words(request: Request) -> dict[str, NDArray]:
    """A signed right shift smears the sign bit."""
    count = request.settings["count"]
    with np.errstate(over="ignore"):
        z = np.uint64(fnv1a(request.settings["seed"])) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(GAMMA)
        signed = z.astype(np.int64)
        signed = (signed ^ (signed >> 30)) * np.uint64(MIX_1).astype(np.int64)
        signed = (signed ^ (signed >> 27)) * np.uint64(MIX_2).astype(np.int64)
        found = (signed ^ (signed >> 31)).astype(np.uint64)
    return {"words": found, "unit_numbers": (found >> np.uint64(40)).astype(np.float64) / 2.0**24}


WRONG_PORTS = [
    WrongPort("fortran_order", "Array read in Fortran order", "first index fastest; right: last index fastest",
              {"reading": output(flat=lambda a: a.reshape(4, 3, 5).reshape(-1, order="F"))}),
    WrongPort("gaussian_first", "Gaussian index taken as the first axis", "[n, ...]; right: [..., n]",
              {"reading": lambda r: {"column": r.inputs["harmonics"].reshape(5, 4, 3)[3]}}),
    WrongPort("mask_inverted", "Mask read the wrong way round", "True = instrument; right: True = tissue",
              {"reading": lambda r: {"tissue_pixels": (~r.inputs["mask"]).sum(),
                                     "tissue_row": np.flatnonzero(r.inputs["mask"][1])}}),
    WrongPort("pixel_corner", "Pixels sampled at their corner", "column i at i; right: at i + 1/2",
              {"reading": output(sample_x=lambda a: a - 0.5, sample_y=lambda a: a - 0.5)}),
    WrongPort("signed_shift", "Generator with signed right shifts", "shifts copy the sign; right: shift in zeros",
              {"generator": _signed_words}),
]  # fmt: skip
