"""Figures printed in the paper, for comparison with measured ones.

The gains of its components stand with the compared configurations, in `endotsr.studies.sweeps.ablation.COMPARISONS`.
"""

import math
from typing import NamedTuple

from endotsr.results.evaluation.records import LabelledMeans

PUBLISHED: dict[str, LabelledMeans] = {  # whole image, every eighth frame held out
    "pulling": {
        "label": "Endo-TSR as published, EndoNeRF pulling",
        "psnr_full": 39.34,
        "ssim_full": 0.967,
        "lpips": 0.035,
    },
    "cutting": {
        "label": "Endo-TSR as published, EndoNeRF cutting",
        "psnr_full": 40.96,
        "ssim_full": 0.980,
        "lpips": 0.019,
    },
}
DIGITS = {"psnr_full": 2, "ssim_full": 3, "lpips": 3, "lpips_symmetric": 3}  # after the point, as printed
MEANS_ON_TISSUE: dict[str, tuple[float, float, float]] = {  # its table of components: PSNR, SSIM, LPIPS, both clips
    "base": (38.08, 0.9537, 0.0309),
    "S": (38.12, 0.9540, 0.0302),
    "A+S": (38.40, 0.9563, 0.0280),
    "A+S+L": (38.52, 0.9569, 0.0271),
}
MATCHED_PSNR = (0.31, 0.66)  # dB over SurgicalGS with matched input: smallest and largest median over the sequences
MATCHED_LPIPS = (-0.0096, -0.0035)
PRIOR = (0.005, -0.002)  # dB, the change by the Matérn prior at a fixed representation and count, one seed each
SURGICALGS = 38.03  # dB, whole image, pulling


def as_printed(key: str, value: float) -> str:
    """A published value with the digits of the paper."""
    return f"{value:.{DIGITS[key]}f}"


class Printed(NamedTuple):
    """PSNR of the whole image that a paper prints for a system, dB; nan where it gives the mean alone."""

    system: str
    source: str  # arXiv number and table
    pulling: float
    cutting: float
    mean: float = math.nan  # of the two, if they are not given


NONE = math.nan
BY_NAME = (  # read in the named papers; every eighth frame held out, as far as they say
    Printed("ColorGS", "2508.18696, table 1", NONE, NONE, 39.85),
    Printed("FeatureEndo-4DGS", "2503.06161", NONE, NONE, 39.1),
    Printed("Local-EndoGS", "2602.17473, tables 3 and 6", 38.73, 39.65),
    Printed("EH-SurGS", "run again in 2602.17473", 38.43, 39.46),
    Printed("SAGS", "2510.27318, table 2; the mean of its table 1 is 39.16", 38.30, 39.51),
    Printed("EndoWave", "2510.23087, table 1", 38.51, 38.93),
    Printed("SurgicalGS", "quoted in 2510.23087", 38.05, 38.31),
    Printed("EndoPrior-GS", "2609.37874", NONE, NONE, 38.07),
    Printed("Diff2DGS", "2602.18314", NONE, NONE, 38.02),
    Printed("Deform3DGS", "run again in 2602.17473", 37.99, 37.92),
    Printed("EndoGaussian", "run again in 2602.17473", 37.19, 38.04),
    Printed("Endo-4DGS", "quoted in 2510.23087", 37.85, 36.56),
    Printed("EndoNeRF", "run again in 2602.17473", 37.72, 35.96),
)
SEVEN_OTHERS = (36.50, 37.21, 37.82, 37.85, 37.09, 38.33, 38.96)  # dB, the same table, in its order
