"""Initialisation, equation (B12): counts, back-projection, neighbours; hard case I1."""

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.splits import every_second
from endotsr.config import InitialisationConfig, ModelConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.training.scene.initialisation import (
    Y00,
    activate_residuals,
    gaussians_at,
    initialise,
    squared_neighbour_distance,
    training_points,
)

HEIGHT, WIDTH = 6, 8
MODEL = ModelConfig(bases=5)


def make(count=5, test=(1,), seed=0) -> Sequence:
    rng = np.random.default_rng(seed)
    angle = 0.3
    rotation = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    camera = Camera(rotation, np.array([1.0, -2.0, 3.0]), 9.0, 11.0, 4.2, 2.9, WIDTH, HEIGHT)
    everything = np.arange(count)
    return Sequence(
        images=rng.integers(0, 256, (count, 3, HEIGHT, WIDTH), np.uint8),
        masks=np.ones((count, HEIGHT, WIDTH), bool),
        depth=np.full((count, HEIGHT, WIDTH), 50.0, np.float32),
        times=everything / count,
        cameras=[camera] * count,
        names=[f"{k:03d}" for k in everything],
        unit="mm",
        static_camera=True,
        train_index=np.setdiff1d(everything, test),
        test_index=np.array(test, np.intp),
    )


def points(sequence, seed=0, **config):
    return training_points(sequence, InitialisationConfig(**config), np.random.default_rng(seed))


def project(camera, position):
    x, y, z = camera.rotation @ position + camera.translation[:, None]
    return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z


def test_points_project_to_their_pixel_centres_with_its_colour_and_depth():
    sequence = make()
    sequence.depth[0] = 40.0 + np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
    position, colour, _ = points(sequence, first_frame_points=10, other_frame_points=0)
    u, v, z = project(sequence.cameras[0], position)
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    np.testing.assert_allclose(u - column, 0.5, atol=1e-11)
    np.testing.assert_allclose(v - row, 0.5, atol=1e-11)
    np.testing.assert_allclose(z, sequence.depth[0, row, column], rtol=1e-12)
    np.testing.assert_array_equal(colour, sequence.images[0][:, row, column] / 255.0)
    assert len(set(zip(column.tolist(), row.tolist(), strict=True))) == 10


def test_fields_at_the_start():
    sequence = make()
    config = InitialisationConfig(first_frame_points=20)
    gaussians = initialise(sequence, config, MODEL, np.random.default_rng(0))
    colour = training_points(sequence, config, np.random.default_rng(0)).colour
    assert all(a is None or (a.dtype == np.float32 and a.flags.c_contiguous) for a in gaussians)
    np.testing.assert_array_equal(gaussians.quaternion, np.tile([[1], [0], [0], [0]], (1, 20)))
    np.testing.assert_allclose(1 / (1 + np.exp(-gaussians.opacity_logit)), 0.1, rtol=1e-6)
    np.testing.assert_allclose(gaussians.harmonics[0] * Y00 + 0.5, colour, atol=1e-6)
    assert gaussians.harmonics.shape == (16, 3, 20) and not gaussians.harmonics[1:].any()
    assert not gaussians.fdm_weight.any()
    np.testing.assert_array_equal(gaussians.fdm_centre[3, :, 7], np.linspace(0, 1, 5, dtype=np.float32))
    assert (gaussians.fdm_width == np.float32(0.01)).all()
    assert gaussians.appearance_coefficients is None and gaussians.motion_coefficients is None
    rigid = initialise(sequence, config, ModelConfig(deformation=False), np.random.default_rng(0), np.float64)
    assert rigid.fdm_weight is None and rigid.position.dtype == np.float64


def test_scale_is_the_root_mean_square_of_three_distances():
    position = np.array([[0.0, 1.0, 0.0, 0.0, 9.0], [0, 0, 2.0, 0, 0], [0, 0, 0, 3.0, 0]])
    brute = []
    for i in range(5):
        squared = sorted(((position[:, i] - position[:, j]) ** 2).sum() for j in range(5) if j != i)
        brute.append(np.mean(squared[:3]))
    np.testing.assert_allclose(squared_neighbour_distance(position), brute, rtol=1e-12)
    gaussians = gaussians_at(position, np.zeros((3, 5)), MODEL, np.float64)
    np.testing.assert_allclose(np.exp(2 * gaussians.log_scale), np.tile(brute, (3, 1)), rtol=1e-12)


def test_other_frames_give_moved_or_newly_visible_pixels_only():
    sequence = make(count=5, test=(1,))
    sequence.masks[0, 0, 0] = False  # newly visible in the others
    sequence.depth[0, 0, 1] = 0.0  # no depth in the first
    sequence.depth[2, 3, 3] = np.nextafter(np.float32(90.0), np.float32(91.0))  # moved by just more than 40
    sequence.depth[2, 3, 4] = 90.0  # moved by exactly the threshold: not moved
    sequence.masks[3, 0, 0] = False
    position, _, _ = points(sequence, first_frame_points=1, other_frame_points=5000)
    u, v, _ = project(sequence.cameras[0], position)
    pixels = list(zip(np.floor(v).astype(int).tolist(), np.floor(u).astype(int).tolist(), strict=True))
    assert pixels[1:] == [(0, 0), (0, 1), (3, 3), (0, 1), (0, 0), (0, 1)]  # frames 2, 3, 4


def test_counts_are_those_of_the_published_rule():
    """n = 10: int(33 / 10) = 3 a frame; held-out frames give none."""
    sequence = make(count=10, test=(1, 9))
    sequence.depth[1:] = 200.0
    position, _, _ = points(sequence, first_frame_points=7, other_frame_points=33)
    assert position.shape == (3, 7 + 3 * 7)


def test_every_second_frame_of_long_clips():
    for count, visited in ((150, 149), (151, 75)):
        sequence = make(count=count, test=())
        sequence.depth[1:] = 200.0
        position, _, _ = points(sequence, first_frame_points=1, other_frame_points=count)
        assert position.shape[1] == 1 + visited


@pytest.mark.parametrize("count, frames", [(150, 75), (151, 1)])
def test_a_long_clip_with_every_second_frame_held_out_starts_with_the_first_frame_alone(count, frames):
    train, test = every_second(count)
    sequence = make(count=count, test=test)
    assert sequence.train_index.tolist() == train.tolist()
    sequence.depth[1:] = 200.0
    assert np.unique(points(sequence, first_frame_points=1, other_frame_points=count).start).size == frames


def test_held_out_frames_are_not_read():
    sequence, changed = make(test=(0, 1)), make(test=(0, 1))
    changed.images[:2], changed.depth[:2], changed.masks[:2] = 0, 999.0, False
    for a, b in zip(points(sequence), points(changed), strict=True):
        np.testing.assert_array_equal(a, b)


def test_seed_decides():
    sequence = make()
    one, two, other = (points(sequence, seed=s, first_frame_points=9)[0] for s in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()


def test_hard_I1_fewer_pixels_than_asked_for_gives_all():
    sequence = make()
    sequence.masks[:, 2:] = False
    position, _, _ = points(sequence)
    assert position.shape == (3, 2 * WIDTH)


def test_hard_I1_no_valid_pixel_is_an_input_error():
    sequence = make()
    sequence.depth[:] = 0.0
    with pytest.raises(InputError, match="tissue with depth"):
        points(sequence)
    with pytest.raises(InputError, match="no training frame"):
        points(make(count=2, test=(0, 1)))


def test_hard_I1_first_frame_empty_uses_the_others():
    sequence = make()
    sequence.masks[0] = False
    assert points(sequence, other_frame_points=10)[0].shape == (3, 2 * 3)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_hard_I1_few_points_have_a_defined_scale(count):
    position = np.arange(3.0 * count).reshape(3, count)
    gaussians = gaussians_at(position, np.zeros((3, count)), MODEL, np.float64)
    assert np.isfinite(gaussians.log_scale).all()
    if count == 1:
        np.testing.assert_allclose(gaussians.log_scale, 0.5 * np.log(1e-7))


def test_hard_I1_duplicates_get_the_floor():
    gaussians = gaussians_at(np.ones((3, 9)), np.zeros((3, 9)), MODEL, np.float64)
    np.testing.assert_allclose(gaussians.log_scale, 0.5 * np.log(1e-7))


def test_hard_I1_depth_that_is_not_a_number_is_no_depth():
    sequence = make()
    sequence.depth[:, 0] = np.nan
    sequence.depth[:, 1] = np.inf
    sequence.depth[:, 2] = -5.0
    assert points(sequence)[0].shape == (3, 3 * WIDTH)


def test_activation_allocates_zeros_for_what_is_on():
    gaussians = gaussians_at(np.eye(3), np.zeros((3, 3)), MODEL, np.float32)
    both = activate_residuals(gaussians, 8, True, True)
    assert both.appearance_coefficients.shape == both.motion_coefficients.shape == (3, 16, 3)
    assert both.appearance_coefficients.dtype == np.float32 and not both.appearance_coefficients.any()
    one = activate_residuals(gaussians, 8, False, True)
    assert one.appearance_coefficients is None and one.motion_coefficients is not None
    both.motion_coefficients[:] = 1.0
    assert activate_residuals(both, 8, True, True).motion_coefficients is both.motion_coefficients


@pytest.mark.data
def test_pulling_sequence_starts_with_the_published_counts():
    """35 000 + up to 79 from each of the 54 other training frames of 63."""
    from endotsr.clips.sequences.read import read_sequence
    from endotsr.config import RasterConfig, SequenceConfig

    sequence = read_sequence(data_folder("endonerf_pulling"), SequenceConfig())
    gaussians = initialise(sequence, InitialisationConfig(), MODEL, np.random.default_rng(0))
    assert 35_000 < gaussians.count <= 35_000 + 79 * 54
    assert all(a is None or np.isfinite(a).all() for a in gaussians)
    u, v, z = project(sequence.cameras[0], gaussians.position.astype(np.float64))
    assert ((0 < u) & (u < sequence.width) & (0 < v) & (v < sequence.height) & (z > RasterConfig().near)).all()
