"""The simulator: its truth is true, and every switch is its own."""

import msgspec
import numpy as np
import pytest

from endotsr.clips.simulator import EFFECTS, SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.sections import Breathing, Pull
from endotsr.clips.simulator.slit import parting
from endotsr.clips.simulator.surface import evaluate, make_surface
from endotsr.errors import InputError

SMALL = SimulatorSettings(width=48, height=40, frames=6, seed=3)
STILL = with_effects(SMALL)


@pytest.fixture(scope="module")
def still():
    return simulate(STILL)


@pytest.fixture(scope="module")
def everything():
    return simulate(with_effects(SMALL, *EFFECTS))


def _project(camera, point):
    x, y, z = np.einsum("ij,j...->i...", camera.rotation, point) + camera.translation[:, None, None]
    return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z


def test_everything_off_gives_identical_frames_and_one_camera(still):
    sequence = still.sequence
    for array in (sequence.images, sequence.depth, still.truth.depth, still.truth.material_coordinates):
        assert (array == array[:1]).all()
    assert sequence.masks.all() and sequence.static_camera
    assert all(camera is sequence.cameras[0] for camera in sequence.cameras)
    np.testing.assert_array_equal(sequence.depth, still.truth.depth.astype(np.float32))


def test_depth_and_pixel_follow_from_the_surface_formula(everything):
    """Project the material point of every pixel with the camera: its own pixel centre and the stored depth return."""
    sequence, truth = everything.sequence, everything.truth
    rows, columns = np.mgrid[0:40, 0:48] + 0.5
    for i in range(sequence.count):
        point = everything.surface_point(truth.material_coordinates[i], sequence.times[i])
        u, v, z = _project(sequence.cameras[i], point)
        known = np.isfinite(truth.material_coordinates[i]).all(axis=0)  # all but the wound of the slit
        assert known.mean() > 0.95 and known.all() == (sequence.times[i] < 0.3)
        assert max(np.abs(u - columns)[known].max(), np.abs(v - rows)[known].max()) < 1e-9
        assert np.abs(z - truth.depth[i])[known].max() < 1e-9
    assert np.ptp(truth.depth) > 3 and 40 < truth.depth.mean() < 60


def test_the_surface_is_the_documented_sum_and_its_derivatives_are_right(everything):
    surface = everything.truth.surface
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-15, 15, (2, 50))
    t, h = 0.43, 1e-5
    height = sum(
        amplitude * np.sin(k[0] * a + k[1] * b + phase)
        for amplitude, k, phase in zip(surface.amplitude, surface.wave.T, surface.phase)
    )
    expected = np.stack([a, b, surface.distance + height])
    for motion in surface.motions:
        expected += motion.course(t) * motion.weight(a, b)[0] * motion.direction[:, None]
    expected[:2] += parting(surface.slit, a, b, None, t)[0] * surface.slit.across[:, None]
    np.testing.assert_allclose(everything.surface_point(np.stack([a, b]), t), expected, rtol=1e-14)
    _, along_a, along_b = evaluate(surface, a, b, t)
    for gradient, da, db in ((along_a, h, 0), (along_b, 0, h)):
        difference = evaluate(surface, a + da, b + db, t)[0] - evaluate(surface, a - da, b - db, t)[0]
        np.testing.assert_allclose(gradient, difference / (2 * h), atol=1e-8)


def test_true_flow_agrees_with_the_pictures(everything):
    """Following the flow, the material coordinates of the target frame are those of the source frame."""
    flow = everything.true_flow(1, 3)
    material = everything.truth.material_coordinates
    row, column = 20, 24
    x, y = column + flow[0, row, column], row + flow[1, row, column]
    left, top = int(x), int(y)
    block = material[3][:, top : top + 2, left : left + 2]
    across, down = x - left, y - top
    found = (block[:, 0] * (1 - down) + block[:, 1] * down) @ np.array([1 - across, across])
    assert np.hypot(*flow[:, row, column]) > 0.3
    np.testing.assert_allclose(found, material[1][:, row, column], atol=0.02)


# What an effect may change beside the pictures: tissue mask, depth prior, true geometry, cameras.
BY_CHANGE = {
    "images": "exposure auto_exposure brightening second_light highlights noise bleeding smoke vignetting",
    "images depth truth": "breathing pulsation pull cutting",
    "images depth truth cameras": "camera_motion",
    "images masks depth": "instrument more_instruments",
    "masks depth": "stereo",
    "depth": "depth_errors depth_rounding",
    "": "shadows motion_blur",  # without instruments, and without motion
}
MAY_CHANGE = {effect: set(parts.split()) for parts, effects in BY_CHANGE.items() for effect in effects.split()}


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_switch_changes_only_what_it_names(still, effect):
    one = simulate(with_effects(SMALL, effect))
    a, b = still.sequence, one.sequence
    changed = {name for name in ("images", "masks", "depth") if (getattr(a, name) != getattr(b, name)).any()}
    if (still.truth.depth != one.truth.depth).any():
        changed.add("truth")
    if not b.static_camera:
        changed.add("cameras")
    assert changed == MAY_CHANGE[effect]


def test_the_instrument_leaves_the_tissue_beside_it_alone(still):
    one = simulate(with_effects(SMALL, "instrument"))
    seen = one.sequence.masks
    assert 0.05 < 1 - seen.mean() < 0.3
    assert (one.sequence.images.transpose(0, 2, 3, 1)[seen] == still.sequence.images.transpose(0, 2, 3, 1)[seen]).all()
    assert (one.sequence.depth[seen] == still.sequence.depth[seen]).all() and (one.sequence.depth[~seen] == 0).all()
    assert not (one.truth.instrument & seen).any()  # the margin covers the smooth outline too


def test_exposure_is_one_gain_for_all_pixels_in_linear_light():
    settings = msgspec.structs.replace(with_effects(SMALL, "exposure"), frames=4)
    dark = simulate(with_effects(settings)).sequence.images[1].astype(float)
    bright = simulate(settings).sequence.images[1].astype(float)
    inside = (dark > 40) & (bright < 250)
    drift = np.array([1.0, 0.85, 0.85 + 0.3 * np.sin(np.pi / 4)])  # a quarter of the cycle
    for channel, gain in enumerate(1 + 0.15 * drift):
        ratio = (bright[channel] / dark[channel])[inside[channel]] ** 2.2
        assert np.median(ratio) == pytest.approx(gain, abs=0.01)


def test_noise_has_its_deviation_and_belongs_to_seed_and_frame(still):
    def noise(seed):
        quiet = msgspec.structs.replace(STILL, seed=seed)
        noisy = simulate(with_effects(quiet, "noise")).sequence.images
        clean = still.sequence.images if seed == SMALL.seed else simulate(quiet).sequence.images
        return np.where((clean > 20) & (clean < 235), noisy.astype(float) - clean, 0.0)

    first, second = noise(SMALL.seed), noise(SMALL.seed + 1)
    assert first[first != 0].size and np.std(first[:, :, 5:]) == pytest.approx(0.01 * 255, rel=0.1)
    for other in (first[1], second[0]):
        assert abs(np.corrcoef(first[0].ravel(), other.ravel())[0, 1]) < 0.1


def test_depth_errors_leave_the_truth_exact(still):
    one = simulate(with_effects(SMALL, "depth_errors"))
    strip = round(0.07 * 48)
    assert (one.sequence.depth[:, :, :strip] == 0).all() and (one.sequence.depth[:, :, strip:] > 0).all()
    np.testing.assert_array_equal(one.truth.depth, still.truth.depth)
    assert np.std((one.sequence.depth - one.truth.depth)[:, :, strip:]) == pytest.approx(0.5, rel=0.05)


def test_motions_start_from_rest():
    for effect in ("breathing", "pulsation", "pull"):
        assert all(motion.course(0.0) == 0.0 for motion in make_surface(with_effects(SMALL, effect)).motions)


def test_another_seed_has_another_surface(everything):
    other = simulate(msgspec.structs.replace(with_effects(SMALL, *EFFECTS), seed=4))
    assert (other.truth.depth != everything.truth.depth).mean() > 0.99


def test_another_image_size_shows_the_same_tissue(still):
    from endotsr.clips.opencv.filters import area_resize

    large = simulate(msgspec.structs.replace(STILL, width=192, height=160, frames=3)).sequence.images[0]
    small = area_resize(large.transpose(1, 2, 0), 48, 40).transpose(2, 0, 1).astype(float)
    difference = np.abs(small - still.sequence.images[0])
    assert np.median(difference) < 4 and np.corrcoef(small.ravel(), still.sequence.images[0].ravel())[0, 1] > 0.97


def test_the_tissue_is_red_textured_and_neither_black_nor_white():
    sequence = simulate(SimulatorSettings(frames=3)).sequence
    image = sequence.images[0].astype(float)
    red, green, blue = (image[c][sequence.masks[0]].mean() for c in range(3))
    assert red > green + 25 > blue and 60 < image.mean() < 190
    assert (image == 255).all(axis=0).mean() < 0.05 and image[1].std() > 15


def test_a_fold_is_refused():
    for settings in (
        msgspec.structs.replace(STILL, relief=8.0),
        msgspec.structs.replace(SMALL, pull=Pull(amplitude=60.0, width=6.0)),
        msgspec.structs.replace(SMALL, breathing=Breathing(amplitude=90.0)),
    ):
        with pytest.raises(InputError, match=r"simulator: at t = .* (sheet|ray)"):
            simulate(settings)


def test_blocks_can_be_held_out():
    sequence = simulate(msgspec.structs.replace(STILL, frames=20, block_length=4)).sequence
    np.testing.assert_array_equal(sequence.test_index, [10, 11, 12, 13])
    with pytest.raises(InputError, match="no held-out block"):
        simulate(msgspec.structs.replace(STILL, block_length=4))
