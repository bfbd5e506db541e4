"""The image-space baselines: exact on sequences with known answers, and the known figures on the real one."""

import numpy as np
import pytest
from made_up_sequence import made_up

from data_folder import data_folder
from endotsr.clips.opencv.flow import warp_bilinear
from endotsr.errors import InputError
from endotsr.results.evaluation import baselines


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def ramp(count=9, step=10, height=4, width=5):
    """Frame i is 20 + step i everywhere."""
    values = (20 + step * np.arange(count)).astype(np.uint8)
    return np.broadcast_to(values[:, None, None, None], (count, 3, height, width)).copy()


def texture(rng, height=48, width=64):
    """A smooth random image with detail of a few pixels, uint8 (3, H, W)."""
    from scipy.ndimage import gaussian_filter

    smooth = gaussian_filter(rng.standard_normal((3, height, width)), (0, 2.0, 2.0))
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    return np.round(255 * smooth).astype(np.uint8)


@pytest.mark.parametrize("held_out", [[1, 4], [3, 4, 5, 6]], ids=["apart", "block"])
def test_linear_brightness_is_recovered_by_two_neighbours(held_out):
    sequence = made_up(ramp(), held_out)
    for index in held_out:
        expected = sequence.images[index] / 255.0
        np.testing.assert_allclose(baselines.two_neighbours(sequence, index), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("times", "grey"), [([0.0, 0.1, 1.0], 0.9 * 20 + 0.1 * 40), ([0.5, 0.5, 0.5], 30)], ids=["uneven", "equal"]
)
def test_blend_follows_the_time_stamps_not_the_frame_numbers(times, grey):
    sequence = made_up(ramp(3), [1])
    sequence.times[:] = times
    np.testing.assert_allclose(baselines.two_neighbours(sequence, 1), grey / 255, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("index", "source"), [(1, 0), (3, 2), (4, 2), (5, 7), (6, 7)])
def test_nearest_frame_is_nearest_in_time_and_ties_go_back(index, source):
    sequence = made_up(ramp(), [1, 3, 4, 5, 6])
    np.testing.assert_array_equal(baselines.nearest_frame(sequence, index), baselines.unit_image(sequence, source))


def test_ties_go_back_for_every_time_stamp_of_the_real_split():
    """i / 63 is not exactly between its neighbours in floating point; rounding must not choose the frame."""
    images = np.arange(63, dtype=np.uint8)[:, None, None, None] * np.ones((1, 3, 2, 2), np.uint8)
    test = [i for i in range(63) if (i - 1) % 8 == 0]
    sequence = made_up(images, test)
    for index in test:
        assert baselines.nearest_frame(sequence, index)[0, 0, 0] == np.float32(index - 1) / np.float32(255)


def test_test_frames_never_leak_into_a_baseline():
    clean = made_up(ramp(height=16, width=16), [1, 4])
    spoiled = made_up(ramp(height=16, width=16), [1, 4])
    spoiled.images[[1, 4]] = 255
    spoiled.masks[[1, 4]] = False
    for _, maker in baselines.BASELINES.values():
        for index in (1, 4):
            np.testing.assert_array_equal(maker(clean)(index), maker(spoiled)(index))


def test_temporal_mean_counts_only_tissue():
    images = ramp(3)
    masks = np.ones((3, 4, 5), bool)
    masks[0, 0, 0] = False  # tissue in frame 2 only
    masks[:, 3, 4] = False  # never tissue
    mean = baselines.temporal_mean(made_up(images, [1], masks))
    np.testing.assert_allclose(mean[:, 1, 1], (20 + 40) / 2 / 255, atol=1e-6)
    np.testing.assert_allclose(mean[:, 0, 0], 40 / 255, atol=1e-6)
    np.testing.assert_array_equal(mean[:, 3, 4], 0)


def test_first_and_last_frame_use_their_only_neighbour():
    sequence = made_up(ramp(4, height=16, width=16), [0, 3])
    for _, maker in list(baselines.BASELINES.values())[1:]:
        np.testing.assert_array_equal(maker(sequence)(0), baselines.unit_image(sequence, 1))
        np.testing.assert_array_equal(maker(sequence)(3), baselines.unit_image(sequence, 2))


def test_no_training_frame_is_refused():
    with pytest.raises(InputError, match="frame 0: no training frame"):
        baselines.two_neighbours(made_up(ramp(1), [0]), 0)


def test_warp_matches_plain_bilinear_interpolation(rng):
    from scipy.ndimage import map_coordinates

    image = rng.random((3, 7, 9))
    flow = rng.uniform(-4, 4, (2, 7, 9))
    rows, columns = np.mgrid[0:7, 0:9].astype(float)
    at = [rows - 0.3 * flow[1], columns - 0.3 * flow[0]]
    expected = np.stack([map_coordinates(plane, at, order=1, mode="nearest") for plane in image])
    np.testing.assert_allclose(warp_bilinear(image, -0.3 * flow), expected, rtol=0, atol=1e-14)
    single = warp_bilinear(image.astype(np.float32), -0.3 * flow)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(warp_bilinear(image, 0 * flow), image)


@pytest.mark.parametrize("fraction", [0.5, 0.25])
def test_flow_interpolation_finds_the_moved_texture(rng, fraction):
    """A texture that moves 6 px right: the flow puts it where it belongs, the blend shows it twice."""
    wide = texture(rng, 48, 96)
    first, last = wide[:, :, 16:80], wide[:, :, 10:74]
    sequence = made_up(np.stack([first, first, last]), [1])
    sequence.times[:] = [0.0, fraction, 1.0]
    inner = (slice(None), slice(8, -8), slice(12, -12))
    truth = _shifted(wide, 16 - 6 * fraction, 64)
    error_flow = np.abs(baselines.flow_interpolation(sequence, 1) - truth)[inner].mean()
    error_blend = np.abs(baselines.two_neighbours(sequence, 1) - truth)[inner].mean()
    assert error_flow < 0.15 * error_blend
    assert error_flow < 0.01


def _shifted(wide, start, width):
    """Columns start .. start + width of `wide` for a fractional start, linear."""
    low, part = int(np.floor(start)), start - np.floor(start)
    return ((1 - part) * wide[:, :, low : low + width] + part * wide[:, :, low + 1 : low + 1 + width]) / 255.0


def test_flow_on_an_image_too_small_for_it_is_the_blend():
    sequence = made_up(ramp(3), [1])
    np.testing.assert_array_equal(baselines.flow_interpolation(sequence, 1), baselines.two_neighbours(sequence, 1))


def psnr_pair(image, truth, mask):
    """Full-image and tissue PSNR from the definition: excluded pixels zeroed in both; squared error over tissue."""
    error = np.where(mask, image.astype(float) - truth, 0.0) ** 2
    return -10 * np.log10(error.mean()), -10 * np.log10(error.sum() / (3 * mask.sum()))


@pytest.fixture(scope="module")
def pulling():
    from PIL import Image

    folder = data_folder("endonerf_pulling")
    read = lambda path: np.asarray(Image.open(path))
    images = np.stack([read(p).transpose(2, 0, 1) for p in sorted((folder / "images").glob("*.png"))])
    masks = np.stack([read(p) == 0 for p in sorted((folder / "masks").glob("*.png"))])
    return made_up(np.ascontiguousarray(images), [i for i in range(63) if (i - 1) % 8 == 0], masks)


@pytest.mark.data
@pytest.mark.parametrize(("name", "full", "tissue", "tolerance"), [
    ("temporal_mean", 27.17, 25.39, 0.0101), ("nearest_frame", 37.71, 35.92, 0.0101),
    ("two_neighbours", 40.51, 38.73, 0.0101), ("flow_interpolation", 41.59, 39.80, 0.05),
])  # fmt: skip
def test_known_figures_on_pulling(pulling, name, full, tissue, tolerance):
    render = baselines.BASELINES[name][1](pulling)
    pairs = [psnr_pair(render(i), pulling.images[i] / 255.0, pulling.masks[i]) for i in pulling.test_index]
    assert np.mean(pairs, axis=0) == pytest.approx([full, tissue], abs=tolerance)
