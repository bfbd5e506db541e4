"""A small simulated scene: a wavy, textured surface that stretches, and an instrument in front of it."""

from collections import namedtuple

import numpy as np

from endotsr.definition.projection import Camera

Sequence = namedtuple("Sequence", "images masks depth times cameras train_index test_index")


def simulate(width=32, height=24, frames=16):
    """Sequence: images (n, 3, H, W) of 8 bit, masks and depth (n, H, W) in scene units; frame 1, 9, ... is held out."""
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (3, 2))[..., None, None]
    y, x = np.mgrid[0.5:height, 0.5:width] / width
    images, depth, masks = [], [], []
    for t in np.arange(frames) / frames:
        shift = 0.05 * np.sin(2 * np.pi * t) * np.sin(np.pi * x) * np.sin(np.pi * y * width / height)  # of the tissue
        waves = np.sin(19 * (x + shift) + phase[:, 0]) * np.cos(15 * (y - shift) + phase[:, 1])
        light = 1 + 0.1 * np.cos(2 * np.pi * t)
        images.append(np.round(255 * np.clip(light * (0.45 + 0.3 * waves), 0, 1)).astype(np.uint8))
        depth.append(4 + 0.4 * np.sin(5 * x) * np.cos(4 * y) + 2 * shift)
        masks.append((x - 0.7 - 0.1 * t) ** 2 + (y - 0.7) ** 2 > 0.05)
    masks, index = np.array(masks), np.arange(frames)
    camera = Camera(np.eye(3), np.zeros(3), 1.0 * width, 1.0 * width, width / 2, height / 2, width, height)
    test, depth = index % 8 == 1, np.where(masks, depth, 0).astype(np.float32)
    return Sequence(np.array(images), masks, depth, index / frames, [camera] * frames, index[~test], index[test])
