"""Small pictures of tissue that moves, and those of recorded clips, for the checks of frames one after another."""

from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter

from data_folder import data_folder
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.sampling import small_picture

HEIGHT, WIDTH = 40, 60
_ROUGH = gaussian_filter(np.random.default_rng(5).normal(size=(HEIGHT + 60, WIDTH + 60)), 3)
_TEXTURE = 110 + 30 * _ROUGH / _ROUGH.std()


def tissue(count, period=40.0):
    """(h, w, 3) pictures that drift to and fro over a texture, with a little noise."""
    rng, found = np.random.default_rng(6), []
    for i in range(count):
        x, y = (round(25 + 25 * np.sin(2 * np.pi * i / p)) for p in (period, 2.7 * period))
        grey = _TEXTURE[y : y + HEIGHT, x : x + WIDTH] + rng.normal(0, 1, (HEIGHT, WIDTH))
        found.append(np.clip(np.stack([1.3 * grey, 0.7 * grey, 0.6 * grey], axis=2), 0, 255).astype(np.int16))
    return found


@cache
def recorded(name):
    """Small pictures of a recorded clip, and small pictures of a part of each."""
    pictures = [read_picture(file) for file in sorted((data_folder(name) / "images").iterdir())]
    return [[small_picture(picture[part]) for picture in pictures] for part in (np.s_[:], np.s_[256:512, 320:640])]
