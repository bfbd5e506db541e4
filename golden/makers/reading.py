"""Family `reading`: how arrays, masks and pixels are addressed, and the generator of words.

A port echoes parts of its inputs. The cases are those of level 0: a port that misreads the axes, the mask or the
pixel centres is refused here, before its equations are judged.
"""

import numpy as np

from makers.making import Spec, given, scalar
from makers.wrong import edit, port

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

CONTRACT, WORDS = "golden.contract", "golden.judge.words"

WRONG_PORTS = [
    port(
        "fortran_order",
        "Array read in Fortran order",
        "first index fastest; right: last index fastest",
        "reading",
        edit(CONTRACT, "array.reshape(-1)", 'array.reshape(-1, order="F")'),
    ),
    port(
        "gaussian_first",
        "Gaussian index taken as the first axis",
        "[n, ...]; right: [..., n]",
        "reading",
        edit(
            CONTRACT,
            'array[..., settings["gaussian"]]',
            'array.reshape(array.shape[-1], *array.shape[:-1])[settings["gaussian"]]',
        ),
    ),
    port(
        "mask_inverted",
        "Mask read the wrong way round",
        "True = instrument; right: True = tissue",
        "reading",
        edit(CONTRACT, 'inputs["harmonics"], inputs["mask"]', 'inputs["harmonics"], ~inputs["mask"]'),
    ),
    port(
        "pixel_corner",
        "Pixels sampled at their corner",
        "column i at i; right: at i + 1/2",
        "reading",
        edit(CONTRACT, ") + 0.5).astype", ")).astype", 2),
    ),
    port(
        "signed_shift",
        "Generator with signed right shifts",
        "shifts copy the sign; right: shift in zeros",
        "generator",
        *(
            edit(WORDS, f"z ^ (z >> np.uint64({bits}))", f"z ^ (z.view(np.int64) >> {bits}).view(np.uint64)")
            for bits in (30, 27, 31)
        ),
    ),
]
