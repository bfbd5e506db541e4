"""Targets between the frames: motion that is known, excluded pixels, cameras."""

import numpy as np
import pytest

from endotsr.clips.flow.between import (
    Flows,
    camera_between,
    flows_between,
    frame_between,
    gap_between,
    motion_between,
)
from endotsr.clips.flow.between_kernels import STEPS, WHOLE, moved_priors
from endotsr.clips.opencv.flow import warp_bilinear
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import Camera, camera_centre

HEIGHT, WIDTH = 96, 128
CAMERA = Camera(np.eye(3), np.zeros(3), 100.0, 100.0, 64.0, 48.0, WIDTH, HEIGHT)


def picture(shift):
    """A smooth pattern with detail, moved to the right by `shift` pixels; (3, H, W) in [0, 255]."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    x = x - shift
    waves = [np.sin(x / 5 + k) * np.cos(y / 7 - k) + 0.5 * np.sin((x + 2 * y) / 3 + k) for k in range(3)]
    return 127 + 60 * np.stack(waves) / 1.5


def two_frames(shift, mask=None, depth=5.0):
    images = np.stack([picture(0.0), picture(shift)]).round().astype(np.uint8)
    masks = np.ones((2, HEIGHT, WIDTH), bool) if mask is None else mask
    prior, times = np.full((2, HEIGHT, WIDTH), depth, np.float32), np.array([0.0, 0.5])
    train, test = np.array([0, 1]), np.array([], int)
    return Sequence(images, masks, prior, times, [CAMERA] * 2, ["a", "b"], "scene units", True, train, test)


def constant(shift):
    field = np.zeros((2, HEIGHT, WIDTH), np.float32)
    field[0] = shift
    return Flows(field, -field)


def between(sequence, fraction, flows):
    """The target between the first two frames."""
    return frame_between(sequence, gap_between(sequence, 0, 1, flows), fraction)


@pytest.mark.parametrize("fraction", [0.25, 0.5, 0.75])
def test_a_translation_is_met_half_way(fraction):
    sequence = two_frames(4.0)
    frame = between(sequence, fraction, flows_between(sequence, 0, 1))
    inner = np.s_[:, 12:-12, 12:-12]
    error = np.abs(frame.image - picture(4.0 * fraction) / 255)[inner]
    blend = (1 - fraction) * sequence.images[0] / 255 + fraction * sequence.images[1] / 255
    assert error.mean() < 0.01 < 0.1 * np.abs(blend - picture(4.0 * fraction) / 255)[inner].mean() + 0.01
    assert error.mean() < 0.2 * np.abs(blend - picture(4.0 * fraction) / 255)[inner].mean()
    assert frame.mask[12:-12, 12:-12].mean() > 0.98
    assert frame.time == pytest.approx(0.5 * fraction)
    np.testing.assert_allclose(frame.depth[frame.mask], 5.0, rtol=1e-6)


def test_both_ends_are_the_frames_themselves():
    sequence = two_frames(4.0)
    flows = flows_between(sequence, 0, 1)
    for fraction, index in ((0.0, 0), (1.0, 1)):
        frame = between(sequence, fraction, flows)
        np.testing.assert_allclose(frame.image, sequence.images[index] / 255, atol=1e-6)


def test_exchanged_frames_give_the_same_picture():
    sequence = two_frames(3.0)
    there = flows_between(sequence, 0, 1)
    back = Flows(there.backward, there.forward)
    a, b = between(sequence, 0.25, there), frame_between(sequence, gap_between(sequence, 1, 0, back), 0.75)
    np.testing.assert_allclose(a.image, b.image, atol=1e-5)
    assert np.array_equal(a.mask, b.mask)
    np.testing.assert_allclose(motion_between(there, 0.25), -motion_between(back, 0.75), atol=1e-5)


def test_the_field_is_that_of_the_point_at_the_moment():
    """f(x) = s x (a stretch): v(x) = f(x / (1 + a s)), exactly, away from the border."""
    stretch, fraction = 0.1, 0.5
    x = np.arange(WIDTH, dtype=np.float32)[None, :] * np.ones((HEIGHT, 1), np.float32)
    forward = np.stack([stretch * x, 0 * x])
    backward = np.stack([-stretch * x / (1 + stretch), 0 * x])
    field = motion_between(Flows(forward, backward), fraction)
    exact = stretch * x / (1 + fraction * stretch)
    np.testing.assert_allclose(field[0][:, :80], exact[:, :80], atol=2e-3)


def test_a_flow_that_the_pictures_contradict_gives_way_to_the_still_blend():
    sequence = two_frames(0.0)
    sequence.images[1, :, :48] = picture(8.0)[:, :48].round().astype(np.uint8)  # the upper half moves
    frame = between(sequence, 0.5, constant(8.0))
    upper, lower = np.s_[:, 12:40, 16:-16], np.s_[:, 60:-12, 16:-16]
    assert np.abs(frame.image - picture(4.0) / 255)[upper].mean() < 0.01
    assert np.abs(frame.image - picture(0.0) / 255)[lower].mean() < 0.01
    blurred = (picture(4.0) + picture(-4.0)) / 2  # the two frames, both moved by the wrong flow
    assert np.abs(blurred - picture(0.0))[lower].mean() / 255 > 0.04


def test_pairs_that_differ_equally_count_equally():
    """Stripes of 16 px, black and white at first and 0.4 and 0.6 later: at rest and half a period on."""
    sequence = two_frames(0.0)
    stripe = np.arange(WIDTH) // 16 % 2
    sequence.images[0], sequence.images[1] = np.where(stripe, 255, 0), np.where(stripe, 153, 102)
    still = 0.5 * np.where(stripe, 1.0 + 0.6, 0.0 + 0.4)
    moved = 0.5 * np.where(np.roll(stripe, 8), 1.0 + 0.4, 0.0 + 0.6)
    frame = between(sequence, 0.5, constant(16.0))
    one_step = 1 / 255**2
    of_still, of_moved = 0.4**2 + one_step, 0.6**2 + one_step  # at rest white meets 0.6, moved it meets 0.4
    expected = (of_moved * still + of_still * moved) / (of_moved + of_still)
    np.testing.assert_allclose(frame.image[0, 40, 40:-40], expected[40:-40], atol=0.02)


@pytest.mark.parametrize("covered", [0, 1])
def test_what_one_frame_excludes_is_made_of_the_other(covered):
    mask = np.ones((2, HEIGHT, WIDTH), bool)
    mask[covered, 30:50, 40:60] = False
    sequence = two_frames(4.0, mask)
    sequence.images[covered, :, 30:50, 40:60] = 255  # an instrument
    frame = between(sequence, 0.5, constant(4.0))
    assert frame.mask[:, 8:-8].all()
    left = 42 if covered == 0 else 38
    hidden = np.s_[:, 32:48, left + 2 : left + 18]
    np.testing.assert_allclose(frame.image[hidden], picture(2.0)[hidden] / 255, atol=0.01)


def test_what_both_frames_exclude_is_no_target():
    mask = np.ones((2, HEIGHT, WIDTH), bool)
    mask[:, 30:50, 40:60] = False
    frame = between(two_frames(0.0, mask), 0.5, constant(0.0))
    assert np.array_equal(frame.mask, mask[0])


def test_no_colour_that_a_mask_excludes_enters_a_target():
    """Bitwise, for a given flow: not by the warp of sixteen pixels, not by the window of the differences."""
    rng = np.random.default_rng(0)
    mask = np.ones((2, HEIGHT, WIDTH), bool)
    mask[0, 30:50, 40:60], mask[1, 35:60, 50:70], mask[:, 80:, 100:] = False, False, False  # the last in both
    flow = Flows(*rng.uniform(-3, 3, (2, 2, HEIGHT, WIDTH)).astype(np.float32))
    one, other = (two_frames(4.0, mask) for _ in range(2))
    other.images[...] = np.where(mask[:, None], other.images, rng.integers(0, 256, other.images.shape))
    for fraction in (0.25, 0.5):
        a, b = (between(sequence, fraction, flow) for sequence in (one, other))
        assert a.mask.sum() > 0.8 * a.mask.size
        for found, again in zip(a[:3], b[:3], strict=True):
            np.testing.assert_array_equal(found, again)


def test_depth_is_that_of_the_frame_that_has_one():
    sequence = two_frames(4.0)
    sequence.depth[0, :, :20], sequence.depth[1, :, 20:] = 0, 6.0
    sequence.depth[1, 10:20, 60:80], sequence.depth[0, 10:20, 60:80] = 0, 0
    frame = between(sequence, 0.5, constant(4.0))
    assert (frame.depth[:, 4:17] == 5).all() and np.allclose(frame.depth[30:, 24:-8], 5.5)
    assert not frame.depth[11:19, 64:76].any()


def test_held_out_pictures_are_not_read():
    sequence = two_frames(4.0)
    three = Sequence(
        **{name: np.insert(getattr(sequence, name), 1, value, axis=0)
           for name, value in (("images", 7), ("masks", False), ("depth", np.nan), ("times", 0.25))},
        cameras=[CAMERA] * 3, names=list("axb"), unit="", static_camera=True,
        train_index=np.array([0, 2]), test_index=np.array([1]),
    )  # fmt: skip
    a = between(sequence, 0.5, flows_between(sequence, 0, 1))
    b = frame_between(three, gap_between(three, 0, 2, flows_between(three, 0, 2)), 0.5)
    assert all(np.array_equal(x, y) for x, y in zip(a[:3], b[:3]))


def test_the_camera_turns_at_constant_speed_and_its_centre_moves_straight():
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_rotvec([0.0, 0.4, 0.0]).as_matrix()
    centre = np.array([1.0, -2.0, 3.0])
    later = CAMERA._replace(rotation=turned, translation=-turned @ centre, fx=110.0)
    between = camera_between(CAMERA, later, 0.25)
    np.testing.assert_allclose(camera_centre(between), 0.25 * centre, atol=1e-12)
    np.testing.assert_allclose(Rotation.from_matrix(between.rotation).as_rotvec(), [0, 0.1, 0], atol=1e-12)
    assert between.fx == 102.5 and camera_between(later, later, 0.5) is later
    for fraction, end in ((0.0, CAMERA), (1.0, later)):
        np.testing.assert_allclose(camera_between(CAMERA, later, fraction).rotation, end.rotation, atol=1e-12)


def bits(array):
    return np.ascontiguousarray(array).view(np.uint8)


@pytest.mark.parametrize("fraction", [0.25, 0.5, 5 / 6])
def test_the_compiled_warps_have_the_bits_of_the_numpy_ones(fraction):
    rng = np.random.default_rng(3)
    flows = Flows(*rng.normal(0, 9, (2, 2, 31, 47)).astype(np.float32))  # many positions are outside
    a, b = np.float32(fraction), np.float32(1.0 - fraction)
    from_earlier, from_later = flows.forward, -flows.backward
    for _ in range(STEPS):
        from_earlier = warp_bilinear(flows.forward, -a * from_earlier)
        from_later = -warp_bilinear(flows.backward, b * from_later)
    field = motion_between(flows, fraction)
    assert np.array_equal(bits(field), bits(b * from_earlier + a * from_later))
    tissue, depth = rng.random((2, 31, 47)) < 0.9, rng.uniform(1, 9, (2, 31, 47)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0
    small = field / 20  # so that whole neighbourhoods occur
    for given in (field, small):
        factors = np.array([-a, 1 - a], np.float32)
        found = moved_priors(tissue, depth, given, factors)
        for k in range(2):
            seen = warp_bilinear(tissue[k].astype(np.float32), factors[k] * given) > WHOLE
            known = warp_bilinear((tissue[k] & (depth[k] > 0)).astype(np.float32), factors[k] * given) > WHOLE
            assert np.array_equal(found.seen[k], seen) and np.array_equal(found.known[k], known)
            assert np.array_equal(bits(found.depth[k]), bits(warp_bilinear(depth[k], factors[k] * given)))
    assert found.known.any() and not found.known.all()
