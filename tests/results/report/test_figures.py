"""Pictures: the window lands on the error, colours mean what the legend says, nothing odd passes for normal."""

import io

import numpy as np
import pytest
from PIL import Image

from endotsr.results.report import figures


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def frame(rng):
    truth = rng.uniform(0.2, 0.8, (3, 32, 48)).astype(np.float32)
    render = truth.copy()
    render[:, 20:24, 30:36] += 0.1
    return render, truth, np.ones((32, 48), bool)


def test_inset_is_where_the_tissue_error_is_largest(frame):
    panels = figures.triptych(*frame)
    assert (panels.height, panels.width) == (8, 12)
    assert panels.row <= 20 and panels.row + 8 >= 24
    assert panels.column <= 30 and panels.column + 12 >= 36


def test_error_under_the_mask_does_not_attract_the_inset(frame):
    render, truth, mask = frame
    render = render.copy()
    render[:, :8, :12] += 0.5
    mask[:8, :12] = False
    panels = figures.triptych(render, truth, mask)
    assert panels.row >= 13
    assert (panels.error[:8, :12] == figures.EXCLUDED).all()


def test_worst_window_equals_a_plain_search(rng):
    error = rng.random((13, 17))
    sums = {(y, x): error[y : y + 4, x : x + 5].sum() for y in range(10) for x in range(13)}
    assert figures.worst_window(error, 4, 5) == max(sums, key=lambda k: sums[k])


def test_error_colours_run_from_zero_to_the_stated_scale(frame):
    render, truth, mask = frame
    panels = figures.triptych(render, truth, mask, scale=0.2)
    table = figures.colour_table(figures.ERROR_MAP)
    np.testing.assert_array_equal(panels.error[0, 0], table[0])
    np.testing.assert_allclose(panels.error[22, 33].astype(int), table[128].astype(int), atol=4)  # 0.1 of 0.2
    assert (figures.triptych(render, truth, mask, scale=0.05).error[22, 33] == table[255]).all()


@pytest.mark.parametrize(("level", "expected"), [(0.0, 0.01), (0.009, 0.01), (0.04, 0.05), (0.7, 1.0)])
def test_error_scale_is_the_next_step_up(level, expected):
    assert figures.error_scale([np.full((4, 4), level)]) == expected


def test_not_a_number_is_painted_and_draws_the_inset(frame):
    render, truth, mask = frame
    render = render.copy()
    render[1, 3, 4] = np.nan
    panels = figures.triptych(render, truth, mask)
    for picture in (panels.render, panels.error):
        assert tuple(picture[3, 4]) == figures.NOT_FINITE
    assert panels.row <= 3 < panels.row + panels.height and panels.column <= 4 < panels.column + panels.width
    assert np.isfinite(panels.scale)
    assert figures.bytes_image(np.full((3, 2, 2), np.inf))[0, 0].tolist() == list(figures.NOT_FINITE)


def test_bytes_are_rounded_and_clipped():
    image = np.array([-0.5, 0.0, 0.5 / 255 + 1e-6, 1.4 / 255, 1.0, 1.7]).reshape(1, 1, 6).repeat(3, axis=0)
    assert figures.bytes_image(image)[0, :, 0].tolist() == [0, 0, 1, 1, 255, 255]


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (5, 9), (32, 48)])
@pytest.mark.parametrize("tissue", [0.0, 0.5])
def test_pictures_of_any_size_and_mask(rng, size, tissue):
    truth, mask = rng.random((3, *size)), rng.random(size) < tissue
    panels = figures.triptych(rng.random((3, *size)), truth, mask)
    assert (panels.error[~mask] == figures.EXCLUDED).all()
    assert mask.any() or (panels.row, panels.column) == (0, 0)
    picture = figures.triptych_picture(panels)
    assert picture.shape == (2 * size[0] + 6, 3 * size[1] + 12, 3)
    inset = picture[size[0] + 6, 0]
    assert (inset == panels.window(panels.render)[0, 0]).all()


def test_frame_surrounds_the_window_and_leaves_it_untouched(frame):
    panels = figures.triptych(*frame)
    marked = figures.framed(panels.render, panels)
    np.testing.assert_array_equal(panels.window(marked), panels.window(panels.render))
    assert (marked[panels.row - 1, panels.column] == 255).all()
    assert (marked[panels.row - 2, panels.column] == 0).all()


def test_depth_colours_and_gaps():
    depth = np.array([[0.0, 40.0, 60.0, 80.0, np.nan]])
    picture = figures.depth_picture(depth, 40.0, 80.0)
    table = figures.colour_table(figures.DEPTH_MAP)
    assert tuple(picture[0, 0]) == figures.EXCLUDED
    np.testing.assert_array_equal(picture[0, 1], table[0])
    np.testing.assert_array_equal(picture[0, 3], table[255])
    assert tuple(picture[0, 4]) == figures.NOT_FINITE


def test_depth_range_ignores_missing_and_excluded():
    depth = np.full((10, 10), 50.0)
    depth[0] = 0
    depth[1] = 900
    mask = np.ones((10, 10), bool)
    mask[1] = False
    depth[2] = 70
    assert figures.depth_range(depth, mask) == (50.0, 70.0)
    assert figures.depth_range(np.zeros((3, 3))) == (0.0, 1.0)
    assert figures.depth_range(np.full((3, 3), 5.0)) == (5.0, 6.0)


@pytest.mark.parametrize("kind", ["png", "webp"])
def test_encoded_pictures_can_be_read_back(frame, kind):
    picture = figures.bytes_image(frame[1])
    decoded = np.asarray(Image.open(io.BytesIO(figures.encode(picture, kind))).convert("RGB"))
    assert decoded.shape == picture.shape
    if kind == "png":
        np.testing.assert_array_equal(decoded, picture)
