"""Figures published in the paper, for comparison with measured ones."""

from endotsr.results.evaluation.records import LabelledMeans

PUBLISHED: dict[str, LabelledMeans] = {
    "pulling": {
        "label": "Endo-TSR as published, EndoNeRF pulling",
        "psnr_full": 39.34,
        "ssim_full": 0.967,
        "lpips": 0.035,
    }
}
