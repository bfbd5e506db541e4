"""Family `reading`: how arrays, masks and pixels are addressed, and the generator of words.

A port echoes parts of its inputs. These are the cases of level 0: they reject a port that misreads the axes, the mask
or the pixel centres before its equations are judged.
"""

import numpy as np

from makers.making import Spec, given, scalar

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
