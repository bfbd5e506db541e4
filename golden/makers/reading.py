"""Family `reading`: how arrays, masks and pixels are addressed, and the generator of words.

A port echoes parts of its inputs. These are the cases of level 0: they reject a port that misreads the axes, the mask
or the pixel centres before its equations are judged.
"""

import numpy as np

from makers.making import Spec, given, scalar
from makers.operations import Declared, Judged

DECLARED = {
    "reading": Declared(
        {
            **{name: Judged(0, scale="exact") for name in ("column", "flat", "scalar", "empty")},
            **{name: Judged(0, scale="exact") for name in ("tissue_pixels", "tissue_row")},
            **{name: Judged(0, "px", "exact") for name in ("sample_x", "sample_y")},
        },
        "`column` = `harmonics[:, :, gaussian]`; `flat` = `harmonics` in row-major order; `scalar` and `empty` as they"
        " are; `tissue_pixels` = number of True; `tissue_row` = columns that are True in row `row` of `mask`;"
        " `sample_x`, `sample_y` = sample positions of all columns, rows",
    ),
    "generator": Declared(
        {name: Judged(0, scale="exact") for name in ("words", "unit_numbers")},
        "the first `count` words of `seed`; `unit_numbers` = (word >> 40) / 2^24",
    ),
}
OPERATIONS = tuple(DECLARED)


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
