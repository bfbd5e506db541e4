"""Small images for the loss tests."""

import numpy as np


def images(shape=(3, 12, 17), seed=0, noise=0.1):
    """A render and an observed frame (C, H, W) in display units."""
    rng = np.random.default_rng(seed)
    observed = rng.uniform(0.1, 0.9, shape)
    return observed + noise * rng.standard_normal(shape), observed


def tool_mask(shape=(12, 17)):
    """Tissue with a tool reaching in from the right and one excluded pixel alone."""
    mask = np.ones(shape, bool)
    mask[shape[0] // 3 : 2 * shape[0] // 3, shape[1] // 2 :] = False
    mask[-1, 0] = False
    return mask
