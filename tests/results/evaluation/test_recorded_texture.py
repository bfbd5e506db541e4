"""The texture of the neighbouring frames: found again where the render moves, and blind to excluded pixels."""

import numpy as np
import pytest
from made_up_sequence import made_up

from endotsr.errors import InputError
from endotsr.results.evaluation.baselines import Neighbours, neighbours, two_neighbours, unit_image
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.evaluation.recorded_texture import around, textured, with_recorded_texture

SIZE, SHIFT = (48, 64), 3  # pixels to the right from frame to frame


def textures(seed: int = 0):
    """A smooth picture and fine texture, each (3, H, W + room for five shifts)."""
    rng = np.random.default_rng(seed)
    height, width = SIZE[0], SIZE[1] + 5 * SHIFT
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    smooth = np.stack([0.5 + 0.25 * np.sin(x / (5 + k)) * np.cos(y / (6 - k)) for k in range(3)])
    return smooth, 0.06 * rng.uniform(-1, 1, smooth.shape)


def moving(masks=None, seed: int = 0):
    """Five frames of smooth picture and texture that move to the right, and the renders of a model without texture."""
    smooth, fine = textures(seed)
    window = [np.s_[:, :, (4 - k) * SHIFT : (4 - k) * SHIFT + SIZE[1]] for k in range(5)]
    images = np.stack([(255 * (smooth + fine)[place]).round().astype(np.uint8) for place in window])
    masks = np.ones((5, *SIZE), bool) if masks is None else masks
    return made_up(images, [1, 3], masks), lambda index: smooth[window[index]].astype(np.float32)


def test_texture_that_moves_with_the_render_is_found_again():
    """The blend of the frames has two copies of it, and the render none."""
    sequence, render = moving()
    inside = np.zeros((5, *SIZE), bool)
    inside[:, 6:-6, 6:-6] = True
    truth, found = unit_image(sequence, 1), with_recorded_texture(sequence, 1, render)
    values = [psnr_tissue(shown, truth, inside[1]) for shown in (render(1), two_neighbours(sequence, 1), found)]
    assert values[2] > max(values[:2]) + 8


def test_a_perfect_render_stays_as_it_is():
    sequence, _ = moving()
    np.testing.assert_allclose(
        with_recorded_texture(sequence, 1, lambda k: unit_image(sequence, k)), unit_image(sequence, 1), atol=1e-6
    )


def test_at_rest_it_is_the_render_and_the_mean_difference():
    """Without motion the flow is zero, and the formula is one line per pixel."""
    rng = np.random.default_rng(1)
    images = np.repeat(rng.integers(60, 200, (1, 3, *SIZE), dtype=np.uint8), 3, axis=0)
    images[2] += 20
    masks = rng.random((3, *SIZE)) > 0.3
    sequence = made_up(images, [1], masks)
    found = with_recorded_texture(sequence, 1, lambda index: np.full((3, *SIZE), np.float32(0.4)))
    weights = np.array([0.5, 0.5])[:, None, None] * masks[[0, 2]]
    texture = (weights[:, None] * (images[[0, 2]] / 255 - 0.4)).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-9)
    expected = np.clip(0.4 + np.where(masks[[0, 2]].any(axis=0), texture, 0), 0, 1)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_no_excluded_colour_changes_anything():
    rng = np.random.default_rng(2)
    masks = np.ones((5, *SIZE), bool)
    masks[:, 10:30, 20:45] = False
    sequence, render = moving(masks)
    spoiled = sequence.images.copy()
    spoiled[:, :, ~masks[0]] = rng.integers(0, 256, (5, 3, int((~masks[0]).sum())), dtype=np.uint8)
    other = made_up(spoiled, [1, 3], masks)
    for index in (1, 3):
        np.testing.assert_array_equal(
            with_recorded_texture(sequence, index, render), with_recorded_texture(other, index, render)
        )


def test_a_pixel_that_no_neighbour_shows_keeps_the_render():
    masks = np.ones((5, *SIZE), bool)
    masks[:, :, 30:] = False
    sequence, render = moving(masks)
    found = with_recorded_texture(sequence, 1, render)
    np.testing.assert_array_equal(found[:, :, 40:], render(1)[:, :, 40:])
    assert np.abs(found - render(1))[:, :, :24].mean() > 0.01


def test_at_the_time_of_a_training_frame_it_is_that_frame():
    sequence, render = moving()
    near = neighbours(sequence, 1)._replace(fraction=0.0)
    np.testing.assert_allclose(textured(sequence, near, render(0), render), unit_image(sequence, 0), atol=1e-5)


def test_one_neighbour_suffices_and_none_is_refused():
    sequence, render = moving()
    alone = made_up(sequence.images[:2], [1], sequence.masks[:2])
    assert psnr_tissue(with_recorded_texture(alone, 1, render), unit_image(alone, 1), alone.masks[1]) > psnr_tissue(
        render(1), unit_image(alone, 1), alone.masks[1]
    )
    with pytest.raises(InputError, match="no training frame"):
        with_recorded_texture(made_up(sequence.images[:1], [0], sequence.masks[:1]), 0, render)


def test_the_neighbours_of_a_time_are_those_of_the_frame_with_this_time():
    sequence, _ = moving()
    for index in (1, 3):
        assert around(sequence, float(sequence.times[index])) == neighbours(sequence, index)
    for index in (0, 2):
        near = around(sequence, float(sequence.times[index]))
        assert (near.before, near.fraction) == (index, 0.0)
    assert around(sequence, 1.0) == around(sequence, float(sequence.times[4])) == Neighbours(4, 4, 0.0)
