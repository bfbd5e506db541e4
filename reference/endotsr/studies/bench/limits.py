"""Lower bounds on the time of each stage, from its work and the measured peaks of the machine.

The work is a number of floating-point operations and of bytes. Operations are counted in the forward and reverse
formulas; a fused multiply-add and a division count as two. Bytes are compulsory traffic: every large array is read once
and written once. The limit is the longer of the two times; a stage can exceed 100 % of it only if data stay in a cache
between stages. Sorting and bookkeeping have almost no arithmetic and are bounded by traffic.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from endotsr.config import PAPER
from endotsr.method.splatting.records import GRADIENT, RECORD  # numbers of a Gaussian, and of a pair's gradients
from endotsr.studies.bench.records import CaseTimes, Limit, Peaks
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS

RADIX_BITS = 11  # of a digit of the depth sort

# Floating-point operations, counted in the formulas.
FDM_FORWARD, FDM_REVERSE, ADAM = 24, 32, 13  # per (channel, basis); per (channel, basis); per number
FOURIER = 12  # per coefficient pair (A, C): two products forward, two reverse, the penalty and its gradient
PROJECTION, HARMONIC = 900, 12  # per Gaussian: covariance, projection; per harmonic coefficient; forward and reverse
BLEND_FORWARD, BLEND_REVERSE = 30, 50  # per blended pair, 2^x by a polynomial
SIMILARITY, PYRAMID = 460, 80  # per channel and pixel, forward and reverse
DEPTH_SMOOTHNESS = 60  # per pixel, forward and reverse, edge detection included


class Work(NamedTuple):
    """The minimum work of a stage per iteration."""

    flop: float
    bytes: float


def work(result: Mapping[str, Any]) -> dict[str, Work]:
    """Work of every stage of a measured case (`endotsr.studies.bench.case.measure`), except "rest"."""
    case, view = result["case"], result["view"]
    n, pixels = case["gaussians"], case["width"] * case["height"]
    size = 8 if case["precision"] == "float64" else 4
    fdm = 3 * DEFORMATION_CHANNELS * case["bases"] * n  # numbers of the three arrays
    spectral = 6 * case["frequencies"] * n  # numbers of A, and of C
    harmonics = 3 * (PAPER.model.harmonics_degree + 1) ** 2  # coefficients
    base = 11 + harmonics  # numbers per Gaussian without time bases and residuals
    seen, listed, blended = view["visible"], view["listed"], view["blended"]
    digits = -(-8 * size // RADIX_BITS)
    gathered = RECORD * seen * size + GRADIENT * listed * size + 12 * seen * size
    return {
        "FDM": Work((FDM_FORWARD + FDM_REVERSE + 3 * ADAM) * fdm / 3, size * (6 * fdm + 2 * DEFORMATION_CHANNELS * n)),
        "Fourier": Work(FOURIER * spectral, size * 3 * spectral),  # A, C, and C for the penalty
        "projection": Work((PROJECTION + HARMONIC * harmonics) * n, size * (3 * base + 30) * n),
        "binning": Work(0, digits * (2 * size + 8) * seen + 16 * listed + gathered),
        "blend forward": Work(BLEND_FORWARD * blended, size * (RECORD * seen + 6 * pixels)),
        "blend reverse": Work(BLEND_REVERSE * blended, size * (RECORD * seen + GRADIENT * listed + 10 * pixels)),
        "L1 and SSIM": Work(3 * SIMILARITY * pixels, size * 3 * 12 * pixels),
        "pyramid": Work(3 * PYRAMID * pixels, size * 3 * 4 * pixels),
        "depth and smoothness": Work(DEPTH_SMOOTHNESS * pixels, size * 12 * pixels),
        "Adam": Work(ADAM * (base * n + 2 * spectral), size * (7 * base * n + 6 * 2 * spectral)),
        "density control": Work(0, size * 8 * n),
    }


def limits(result: CaseTimes, peaks: Peaks) -> dict[str, Limit]:
    """The lower bound of each stage.

    peaks   from `endotsr.studies.bench.peaks.measure_peaks` with the threads of the case
    """
    flop_rate = peaks["flop_per_second"][result["case"]["precision"]]
    byte_rate = max(peaks["bytes_per_second"].values())
    found: dict[str, Limit] = {}
    for name, (flop, traffic) in work(result).items():
        arithmetic, memory = 1e3 * flop / flop_rate, 1e3 * traffic / byte_rate
        limit, median = max(arithmetic, memory), result["stages"][name]["median_ms"]
        found[name] = {
            "limit_ms": limit,
            "bound": "arithmetic" if arithmetic > memory else "memory",
            "fraction": limit / median if median > 0 else None,
        }
    return found
