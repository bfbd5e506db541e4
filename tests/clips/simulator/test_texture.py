"""The maps of the tissue are read between their texels as bilinear interpolation says."""

import numpy as np
from scipy.ndimage import map_coordinates

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.texture import make_texture, sample

TEXTURE = make_texture(SimulatorSettings(width=64, height=48))


def material(x, y):
    """Material coordinates of places given in texels."""
    return np.stack([TEXTURE.origin[0] + x * TEXTURE.step[0], TEXTURE.origin[1] + y * TEXTURE.step[1]])


def test_maps_are_interpolated_between_texels():
    rows, columns, maps = TEXTURE.values.shape
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, columns - 2, (7, 9)), rng.uniform(0, rows - 2, (7, 9))
    found = sample(TEXTURE, material(x, y))
    assert found.shape == (maps, 7, 9) == (5, 7, 9)
    for k in range(maps):
        expected = map_coordinates(TEXTURE.values[..., k].astype(float), [y, x], order=1)
        np.testing.assert_allclose(found[k], expected, rtol=1e-9, atol=1e-12)


def test_the_border_value_holds_outside():
    rows, columns, _ = TEXTURE.values.shape
    far = np.array([[-50.0, columns + 50.0, 3.0, np.nan]])
    found = sample(TEXTURE, material(far, np.array([[5.0, 5.0, rows + 80.0, 5.0]])))
    for k, place in enumerate([(5, 0), (5, columns - 1), (rows - 1, 3), (5, 0)]):
        np.testing.assert_allclose(found[:, 0, k], TEXTURE.values[place], rtol=1e-2, atol=1e-3)


def test_views_of_memory_are_read_like_arrays():
    grid = material(*np.meshgrid(np.arange(3.0, 9.0), np.arange(2.0, 7.0)))
    assert np.array_equal(sample(TEXTURE, grid[:, ::2, 1:]), sample(TEXTURE, grid)[:, ::2, 1:])
