"""Tissue that moves, and text that stands still over it."""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

HEIGHT, WIDTH, FRAMES = 192, 256, 12
_ROUGH = gaussian_filter(np.random.default_rng(0).uniform(0, 255, (HEIGHT + 80, WIDTH + 80)), 1.5)
TEXTURE = np.interp(_ROUGH, (_ROUGH.min(), _ROUGH.max()), (40, 190))


def tissue(i, step=4):
    """Red tissue that moves by some pixels a frame."""
    grey = TEXTURE[i * step // 2 : i * step // 2 + HEIGHT, i * step : i * step + WIDTH]
    return np.stack([grey + 60, grey / 2, grey / 2], axis=2).astype(np.uint8)


def with_text(picture):
    found = np.ascontiguousarray(picture)
    cv2.putText(found, "MEIER 1234", (40, 60), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 1)
    return found
