"""The median depth of the tissue of a frame: holes and excluded pixels do not count."""

from dataclasses import replace

import numpy as np

from endotsr.training.scene.workload import sequence as made_up_sequence


def test_holes_and_excluded_pixels_do_not_count_and_nothing_known_is_none():
    clip = made_up_sequence(24, 16, frames=6)
    depth, masks = np.zeros_like(clip.depth), np.ones_like(clip.masks)
    depth[0, 0, :5] = [10.0, 20.0, 30.0, 1000.0, 2000.0]
    masks[0, 0, 3:5] = False
    clip = replace(clip, depth=depth, masks=masks)
    assert clip.tissue_depth(0) == 20.0
    assert clip.tissue_depth(1) is None
