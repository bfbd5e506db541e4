"""Errors recomputed from the images, visits counted by hand, settings that leave parts out."""

import json

import numpy as np
import pytest
from made_up import moving_scene
from pages.tradeoff.dials import TILES
from pages.tradeoff.kernels import Variant
from pages.tradeoff.study import run_whole_study

from endotsr.method.splatting import compositing
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.projection import footprint
from endotsr.method.splatting.render import render_forward
from endotsr.method.splatting.settings import PRESETS
from endotsr.studies.bench.pairs import count_pairs
from endotsr.studies.tradeoff.measure import errors, forward, frame, prepare, reverse, terms, upsampling
from endotsr.studies.tradeoff.settings import ACCURATE, CLOSE, joint
from endotsr.studies.tradeoff.study import cost_of, described
from endotsr.training.fitting.model import scene_at

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study():
    frames = {}
    found = run_whole_study(moving_scene(count=30, width=24), repeats=1, keep=frames.__setitem__)
    return described(found), frames


def test_every_error_of_the_chart_is_that_of_the_images(study):
    """Written out here, from the frames, for every point."""
    result, frames = study
    exact, exact_gradients = frames["reference"]
    assert len(result["points"]) > 80
    for point in result["points"]:
        image, gradients = frames[point["file"]]
        difference = (image - exact).ravel()
        assert point["error"]["max"] == abs(difference).max(), point["name"]
        assert point["error"]["rms"] == pytest.approx(np.sqrt(sum(difference**2) / difference.size), rel=1e-12)
        for block, value in point["error"]["gradients"].items():
            wanted = exact_gradients[block]
            got = gradients[block] if block in gradients else 0 * wanted
            ratio = np.sqrt(((got - wanted) ** 2).sum() / (wanted**2).sum())
            assert value == pytest.approx(ratio, rel=1e-9, abs=1e-300), (point["name"], block)


def test_errors_of_equal_renderings_are_equal_to_the_bit():
    """The page compares errors without a scatter."""
    scene = moving_scene(count=30, width=24)
    setting = next(iter(joint(degree=3, near=scene.near).values()))
    (one, _), (other, _) = (frame(prepare(scene, setting)) for _ in range(2))
    assert one.colour.tobytes() == other.colour.tobytes()


def test_the_study_is_json_and_its_names_resolve(study):
    result = json.loads(json.dumps(study[0]))
    names = [point["name"] for point in result["points"]]
    assert len(set(names)) == len(names)
    used = [n for dial in result["dials"] for n in dial["points"].values()]
    used += [*result["joint"], *result["presets"].values(), *(n for front in result["fronts"].values() for n in front)]
    assert set(used) == set(names)
    assert result["reference"]["certificate"]["holds"]
    expected = {"precision", "cutoff", "stop", "clamp", "support", "exponential", "harmonics", "resolution", "bases",
                "frequencies", "tile", "threads"}  # fmt: skip
    assert {dial["name"] for dial in result["dials"]} == expected


def test_lossless_dials_have_one_error(study):
    result, frames = study
    by_name = {p["name"]: p for p in result["points"]}
    for dial in result["dials"]:
        if dial["lossless"]:
            images = [frames[by_name[n]["file"]].colour for n in dial["points"].values()]
            assert all(np.array_equal(image, images[0]) for image in images), dial["name"]
            assert len({by_name[n]["error"]["max"] for n in dial["points"].values()}) == 1


def test_fronts_hold_what_nothing_dominates(study):
    """By brute force over all pairs of candidates."""
    result, _ = study
    candidates = [p for p in result["points"] if p["name"] in {*result["joint"], *result["presets"].values()}]
    for cost, front in result["fronts"].items():
        chosen = {
            p["name"]
            for p in candidates
            if not any(
                cost_of(q, cost) <= cost_of(p, cost)
                and q["error"]["max"] <= p["error"]["max"]
                and (cost_of(q, cost), q["error"]["max"]) != (cost_of(p, cost), p["error"]["max"])
                for q in candidates
            )
        }
        places = {(cost_of(p, cost), p["error"]["max"]) for p in candidates if p["name"] in chosen}
        assert set(front) <= chosen and len(front) == len(places), cost


def pairs_by_hand(saved, settings, width, height):
    """Visited and blended pairs, pixel by pixel from the projected Gaussians, in plain Python."""
    projected, visited, blended = saved.projected, 0, 0
    logit = saved.scene.opacity_logit
    A, m, r = footprint(projected)
    for row in range(height):
        for column in range(width):
            t = 1.0
            for i in np.argsort(projected.depth, kind="stable"):
                if not projected.visible[i]:
                    continue
                dx, dy = column + 0.5 - projected.mean2d[0, i], row + 0.5 - projected.mean2d[1, i]
                q = r[i] * dy**2 + A[i] * (dx - m[i] * dy) ** 2
                alpha = min(settings.alpha_max, np.exp(-q / 2) / (1 + np.exp(-logit[i])))
                if alpha < settings.alpha_cutoff:
                    visited += settings.support == "everywhere"
                    continue
                visited += 1
                if t * (1 - alpha) < settings.transmittance_stop:
                    break
                t *= 1 - alpha
                blended += 1
    return visited, blended


@pytest.mark.parametrize("preset", ["paper", "exact"])
@pytest.mark.parametrize("path", ["auto", "definition"])
def test_pairs_are_counted_right_on_both_paths(preset, path):
    scene = moving_scene(count=60, width=20)
    scene.gaussians.opacity_logit[:] += 2  # some pixels finish early
    view, _ = scene_at(scene.gaussians, scene.spectral, scene.model, scene.time)
    _, saved = render_forward(view, scene.camera, PRESETS[preset], compositor=path)
    found, by_hand = count_pairs(saved), pairs_by_hand(saved, PRESETS[preset], scene.camera.width, scene.camera.height)
    assert (found.visited, found.blended) == by_hand and found.blended > 0
    unstopped = pairs_by_hand(saved, PRESETS[preset]._replace(transmittance_stop=0.0), 20, 16)
    assert preset == "exact" or by_hand < unstopped


def test_all_parts_kept_is_nothing_left_out():
    scene = moving_scene()
    whole = frame(prepare(scene, ACCURATE))[0]
    kept = frame(prepare(scene, ACCURATE._replace(bases=scene.bases, frequencies=scene.frequencies, scale=1.0)))[0]
    assert np.array_equal(whole.colour, kept.colour)
    fewer = prepare(scene, ACCURATE._replace(bases=1, frequencies=0))
    assert terms(fewer) == 10 * scene.gaussians.count < terms(prepare(scene, ACCURATE))


def test_the_strongest_bases_and_the_lowest_frequencies_are_kept():
    scene = moving_scene()
    scene.gaussians.fdm_weight[:, 1] *= 100
    found = prepare(scene, ACCURATE._replace(bases=1, frequencies=1))
    np.testing.assert_array_equal(found.gaussians.fdm_weight[:, 0], scene.gaussians.fdm_weight[:, 1])
    F = scene.frequencies
    np.testing.assert_array_equal(found.gaussians.motion_coefficients, scene.gaussians.motion_coefficients[:, [0, F]])
    assert found.spectral.omega.tolist() == scene.spectral.omega[:1].tolist()
    np.testing.assert_array_equal(found.spectral.statistics.rms, scene.spectral.statistics.rms[[0, F]])


def test_upsampling_is_linear_interpolation_between_pixel_centres():
    for small, large in ((4, 8), (3, 7), (1, 5), (5, 5)):
        matrix = upsampling(small, large)
        np.testing.assert_allclose(matrix.sum(axis=1), 1)
        centres = (np.arange(small) + 0.5) / small
        wanted = np.clip((np.arange(large) + 0.5) / large, centres[0], centres[-1])
        np.testing.assert_allclose(matrix @ centres, wanted)


def test_gradients_at_half_size_are_those_of_the_same_functional():
    """<weights, up-sampled image> by a step of the colours, against the gradient."""
    scene = moving_scene()
    setting = ACCURATE._replace(scale=0.5, degree=0)
    ready = prepare(scene, setting)
    _, saved, scene_saved = forward(ready)
    gradient = reverse(ready, saved, scene_saved).d_harmonics[0]
    step = np.random.default_rng(0).normal(size=gradient.shape)

    def functional(sign):
        moved = scene.gaussians.harmonics.copy()
        moved[0] += sign * 1e-4 * step
        changed = type(scene)(**(scene.__dict__ | {"gaussians": scene.gaussians._replace(harmonics=moved)}))
        out = forward(prepare(changed, setting))[0]
        return (out.colour * ready.d_colour).sum() + (out.depth * ready.d_depth).sum()

    assert (functional(1) - functional(-1)) / 2e-4 == pytest.approx((gradient * step).sum(), rel=1e-6)


def test_kernels_are_back_in_place_after_use():
    blocks, definition = compositing_blocks._blend_kernel, compositing._composite_kernel
    with pytest.raises(RuntimeError), Variant(exponential=3, tile=TILES[0])():
        assert compositing_blocks._blend_kernel is not blocks
        assert compositing._composite_kernel is not definition
        raise RuntimeError
    assert compositing_blocks._blend_kernel is blocks and compositing._composite_kernel is definition
    assert compositing.TILE_WIDTH == 16


def test_a_missing_block_counts_as_zero():
    scene = moving_scene()
    whole = frame(prepare(scene, ACCURATE))[0]
    without = frame(prepare(scene, ACCURATE._replace(frequencies=0)))[0]
    assert errors(without, whole).gradients["residual"] == 1
    assert CLOSE.alpha_cutoff == 1e-9


def test_settings_of_one_precision_share_their_arrays():
    """A hundred casts of a trained scene would need tens of gigabytes."""
    scene, shared = moving_scene(count=6, width=16), {}
    coarse = ACCURATE._replace(raster=CLOSE._replace(alpha_cutoff=1e-4))
    one, two = (prepare(scene, setting, shared) for setting in (ACCURATE, coarse))
    assert one.gaussians is two.gaussians and one.d_colour is two.d_colour
    fewer, small = (
        prepare(scene, ACCURATE._replace(bases=1), shared),
        prepare(scene, ACCURATE._replace(scale=0.5), shared),
    )
    assert fewer.gaussians.fdm_weight.shape[1] == 1 < one.gaussians.fdm_weight.shape[1]
    assert small.gaussians is one.gaussians and small.d_colour.shape[-1] == 8
