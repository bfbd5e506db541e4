"""Figures printed in the paper, for comparison with measured ones.

The gains of its components stand with the compared configurations, in `endotsr.studies.sweeps.ablation.COMPARISONS`.
"""

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
SEVEN_OTHERS = (36.50, 37.21, 37.82, 37.85, 37.09, 38.33, 38.96)  # dB, the same table, in its order
