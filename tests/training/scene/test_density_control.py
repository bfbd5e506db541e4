"""Density control, equation (B11): selection, order of the result, inheritance; hard cases G1-G4."""

import copy
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from endotsr.config import DensityConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.training.fitting.adam import AdamState, adam_state, adam_update, regather
from endotsr.training.fitting.checkpoint_values import check_lengths
from endotsr.training.scene.density_control import (
    DensityStatistics,
    _rotations,
    densify,
    empty_statistics,
    gather_statistics,
    scene_extent,
)
from endotsr.training.scene.gaussians import Gaussians, arrays

CONFIG = DensityConfig()
EXTENT = 10.0  # clones up to a semi-axis of 0.1


def make(rng, count, dtype=np.float64, residuals=True) -> tuple[Gaussians, AdamState]:
    """Random Gaussians with opacity about one half, every number different, and non-zero moments."""

    def normal(*shape):
        return rng.normal(size=shape).astype(dtype)

    gaussians = Gaussians(
        position=normal(3, count),
        quaternion=normal(4, count),
        log_scale=np.full((3, count), np.log(0.01), dtype) + 0.1 * normal(3, count),
        opacity_logit=normal(count),
        harmonics=normal(4, 3, count),
        fdm_weight=normal(10, 2, count),
        fdm_centre=normal(10, 2, count),
        fdm_width=normal(10, 2, count),
        appearance_coefficients=normal(3, 4, count) if residuals else None,
        motion_coefficients=normal(3, 4, count) if residuals else None,
    )
    adam = adam_state(arrays(gaussians))
    adam_update(
        adam, arrays(gaussians), {n: normal(*a.shape) for n, a in arrays(gaussians).items()},
        dict.fromkeys(arrays(gaussians), 1e-3), 0.9, 0.999, 1e-15,
    )  # fmt: skip
    return gaussians, adam


def steep(count, *indices) -> DensityStatistics:
    """Statistics in which the named Gaussians are above the threshold."""
    statistics = empty_statistics(count)
    statistics.visits[:] = 2
    statistics.gradient_sum[list(indices)] = 1e-3
    return statistics


class Round(NamedTuple):
    """Result of a densification and the moments that followed it."""

    gaussians: Gaussians
    adam: AdamState
    statistics: DensityStatistics
    cloned: int
    split: int
    pruned: int


def densified(gaussians, adam, statistics, config, rng, extent, remaining=1) -> Round:
    """As a training does it; `adam` is left as it is."""
    result, moved = densify(gaussians, statistics, config, rng, extent, remaining), copy.deepcopy(adam)
    regather(moved, arrays(gaussians), result.plan.source, result.plan.survivors)
    return Round(result.gaussians, moved, *result[2:])


def run(gaussians, adam, statistics, config=CONFIG, seed=0, extent=EXTENT, remaining=1):
    result = densified(gaussians, adam, statistics, config, np.random.default_rng(seed), extent, remaining)
    check_lengths(result.gaussians, result.adam)
    assert result.statistics.visits.shape == (result.gaussians.count,)
    assert not result.statistics.visits.any() and not result.statistics.gradient_sum.any()
    return result


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def scene(rng):
    """Six Gaussians: 1 is to be cloned, 3 is large and to be split, 4 is faint, the rest is at rest."""
    gaussians, adam = make(rng, 6)
    gaussians.log_scale[:, 3] = np.log([0.5, 0.2, 0.01])
    gaussians.opacity_logit[4] = -6.0  # opacity 0.0025
    return gaussians, adam, steep(6, 1, 3, 4)


def test_order_of_the_result_and_inheritance_G4(scene):
    gaussians, adam, statistics = scene
    result = run(gaussians, adam, statistics)
    assert (result.cloned, result.split, result.pruned) == (1, 1, 1)
    sources = [0, 1, 2, 5, 1, 3, 3]  # survivors, clones, first children, second children
    for name, array in arrays(result.gaussians).items():
        old = getattr(gaussians, name)
        columns = slice(None) if name not in ("position", "log_scale") else slice(0, 5)
        np.testing.assert_array_equal(array[..., columns], old[..., sources][..., columns], err_msg=name)
        assert array.flags.c_contiguous and array.dtype == old.dtype
        for moments, old_moments in ((result.adam.first, adam.first), (result.adam.second, adam.second)):
            np.testing.assert_array_equal(moments[name][..., :4], old_moments[name][..., sources[:4]])
            assert not moments[name][..., 4:].any()
    assert result.adam.step == adam.step


def test_children_are_smaller_and_drawn_from_the_parent(scene):
    gaussians, adam, statistics = scene
    result = run(gaussians, adam, statistics, seed=9)
    noise = np.random.default_rng(9).standard_normal((2, 3, 1))
    q = gaussians.quaternion[:, 3] / np.linalg.norm(gaussians.quaternion[:, 3])
    for child in range(2):
        local = np.exp(gaussians.log_scale[:, 3]) * noise[child, :, 0]
        w, v = q[0], q[1:]
        rotated = local + 2 * w * np.cross(v, local) + 2 * np.cross(v, np.cross(v, local))
        np.testing.assert_allclose(
            result.gaussians.position[:, 5 + child], gaussians.position[:, 3] + rotated, rtol=1e-12
        )
        np.testing.assert_allclose(
            np.exp(result.gaussians.log_scale[:, 5 + child]), np.exp(gaussians.log_scale[:, 3]) / 1.6, rtol=1e-12
        )


def test_inputs_are_left_as_they_are(scene):
    gaussians, adam, statistics = scene
    before = {name: a.copy() for name, a in arrays(gaussians).items()}
    run(gaussians, adam, statistics)
    for name, array in before.items():
        np.testing.assert_array_equal(array, getattr(gaussians, name))
    assert statistics.gradient_sum.any()


def test_components_that_are_off_stay_off(rng):
    gaussians, adam = make(rng, 3, residuals=False)
    result = run(gaussians, adam, steep(3, 0))
    assert result.gaussians.appearance_coefficients is None
    assert "appearance_coefficients" not in result.adam.first


def test_threshold_and_size_rule_are_closed_on_the_stated_side(rng):
    gaussians, adam = make(rng, 3)
    statistics = empty_statistics(3)
    statistics.visits[:] = 1
    statistics.gradient_sum[:] = [CONFIG.gradient_threshold, np.nextafter(CONFIG.gradient_threshold, 0), 1.0]
    gaussians.log_scale[:, 0] = 0.0  # semi-axis exactly 1 = 0.1 x extent 10
    gaussians.log_scale[:, 2] = 1e-9
    config = msgspec.structs.replace(CONFIG, dense_fraction=0.1)
    result = run(gaussians, adam, statistics, config)
    assert (result.cloned, result.split) == (1, 1)
    np.testing.assert_array_equal(result.gaussians.position[:, 2], gaussians.position[:, 0])


def test_maximum_lets_the_steepest_in_first(rng):
    gaussians, adam = make(rng, 5)
    statistics = empty_statistics(5)
    statistics.visits[:] = 1
    statistics.gradient_sum[:] = [1.0, 3.0, 2.0, 3.0, 0.0]
    result = run(gaussians, adam, statistics, msgspec.structs.replace(CONFIG, maximum=7))
    assert result.cloned == 2
    np.testing.assert_array_equal(result.gaussians.position[:, 5:], gaussians.position[:, [1, 3]])
    assert run(gaussians, adam, statistics, msgspec.structs.replace(CONFIG, maximum=3)).gaussians.count == 5


def test_maximum_breaks_ties_by_index(rng):
    """Odd ones are steeper, all alike; a sort that is not stable would take 13 before 9."""
    gaussians, adam = make(rng, 16)
    statistics = steep(16, *range(16))
    statistics.gradient_sum[1::2] *= 2
    result = run(gaussians, adam, statistics, msgspec.structs.replace(CONFIG, maximum=21))
    np.testing.assert_array_equal(result.gaussians.position[:, 16:], gaussians.position[:, 1:11:2])


def test_a_budget_takes_the_steepest_in_equal_steps(rng):
    """15 places are left for three densifications: five now, whatever the threshold says; one was pruned."""
    gaussians, adam = make(rng, 16)
    gaussians.opacity_logit[:] = 0.0
    gaussians.opacity_logit[4] = -9.0
    statistics = empty_statistics(16)
    statistics.visits[:] = 1
    statistics.gradient_sum[:] = 1e-9 * np.arange(16)
    budget = msgspec.structs.replace(CONFIG, growth="budget", maximum=30)
    result = run(gaussians, adam, statistics, budget, remaining=3)
    assert (result.cloned, result.pruned, result.gaussians.count) == (5, 1, 20)
    np.testing.assert_array_equal(result.gaussians.position[:, 15:], gaussians.position[:, 11:])
    assert run(gaussians, adam, statistics, budget, remaining=1).gaussians.count == 15 + 14, "gradient 0 adds nothing"
    assert run(gaussians, adam, statistics, msgspec.structs.replace(budget, maximum=3)).gaussians.count == 15


def test_statistics_are_in_NDC_units_and_count_visible_views():
    statistics = empty_statistics(3)
    d_mean = np.array([[3.0, 1.0, 0.0], [4.0, 1.0, 0.0]], np.float32)
    gather_statistics(statistics, d_mean, np.array([True, False, True]), 2, 2)
    gather_statistics(statistics, d_mean, np.array([True, False, False]), 4, 2)
    np.testing.assert_allclose(statistics.gradient_sum, [5.0 + np.hypot(6.0, 4.0), 0.0, 0.0])
    np.testing.assert_array_equal(statistics.visits, [2, 0, 1])
    with pytest.raises(ValueError, match="statistics of 3"):
        gather_statistics(statistics, d_mean[:, :2], np.ones(2, bool), 2, 2)


def test_hard_G1_coinciding_cameras_do_not_give_extent_zero():
    still = Camera(np.eye(3), np.array([0.0, 0.0, 5.0]), 1.0, 1.0, 0.5, 0.5, 1, 1)
    assert scene_extent(CONFIG, [still, still]) == 10.0
    by_cameras = DensityConfig(extent="cameras")
    with pytest.raises(InputError, match=r"density\.extent"):
        scene_extent(by_cameras, [still, still])
    moved = still._replace(translation=np.array([4.0, 0.0, 5.0]))
    assert scene_extent(by_cameras, [still, moved]) == pytest.approx(2.2)


def test_hard_G2_never_visited_has_gradient_zero(rng):
    gaussians, adam = make(rng, 2)
    with np.errstate(all="raise"):
        result = run(gaussians, adam, empty_statistics(2))
    assert (result.cloned, result.split, result.pruned) == (0, 0, 0)


def test_hard_G3_prune_to_nothing_then_go_on(rng):
    gaussians, adam = make(rng, 4)
    gaussians.opacity_logit[:] = -800.0
    result = run(gaussians, adam, steep(4, 0, 1))
    assert (result.gaussians.count, result.pruned) == (0, 4)
    assert result.gaussians.harmonics.shape == (4, 3, 0)
    named = arrays(result.gaussians)
    adam_update(
        result.adam, named, {n: a.copy() for n, a in named.items()}, dict.fromkeys(named, 0.1), 0.9, 0.999, 1e-15
    )
    again = run(result.gaussians, result.adam, result.statistics)
    assert again.gaussians.count == 0


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_hard_G4_lengths_agree_after_many_rounds(rng, dtype):
    gaussians, adam = make(rng, 8, dtype)
    gaussians.log_scale[:, ::2] = 0.0
    generator = np.random.default_rng(3)
    for _ in range(4):
        statistics = steep(gaussians.count, *generator.choice(gaussians.count, 3, replace=False))
        result = densified(gaussians, adam, statistics, CONFIG, generator, EXTENT)
        gaussians, adam = result.gaussians, result.adam
        check_lengths(gaussians, adam)
        assert gaussians.position.dtype == dtype
    assert gaussians.count == 20


@pytest.mark.parametrize("opacity", [1e-8, 0.005, 0.3, 0.9])
def test_fainter_is_told_on_the_logit(rng, opacity):
    logit = np.log(opacity / (1 - opacity)) + np.array([-1e-6, 1e-6])
    assert pruned(rng, logit, opacity) == [True, False]
    assert pruned(rng, np.array([-800.0, 800.0]), 1.0) == [True, True]


def pruned(rng, logit, opacity):
    """Which Gaussians of these logits are removed."""
    gaussians, adam = make(rng, logit.size)
    gaussians.opacity_logit[:] = logit
    config = msgspec.structs.replace(CONFIG, prune_opacity=opacity)
    kept = run(gaussians, adam, empty_statistics(logit.size), config).gaussians.opacity_logit
    return [value not in kept for value in logit]


@pytest.mark.parametrize("opacity", [0.0, -1.0])
def test_a_pruning_bound_of_zero_keeps_everything(rng, opacity):
    assert not any(pruned(rng, np.array([-1e4, -800, -1, 0, 800]), opacity))


def test_rotations_of_quaternions_with_zeros_and_of_any_length():
    quaternion = np.array(
        [
            [0, 1, 0, 0],
            [0, 0, 3, 0],
            [1, 0, 0, 1],
            [2, 0, -1, 0],
            [1e-200, 0, 1e-200, 0],
            [1, 2, 3, 4.0],
            [0, -1, 0, 0],
            [-1, -2, -3, -4],
        ]
    )
    wanted = Rotation.from_quat(np.roll(quaternion / np.abs(quaternion).max(axis=1, keepdims=True), -1, axis=1))
    np.testing.assert_allclose(_rotations(quaternion.T), np.moveaxis(wanted.as_matrix(), 0, -1), atol=1e-15)


def test_zero_quaternion_and_huge_scale_split_finitely(rng):
    gaussians, adam = make(rng, 2)
    gaussians.quaternion[:, 0] = 0.0
    gaussians.log_scale[:, 0] = [1.0, -800.0, 0.0]
    gaussians.quaternion[:, 1] = 1e-300
    gaussians.log_scale[:, 1] = 800.0
    result = run(gaussians, adam, steep(2, 0, 1))
    assert result.split == 2
    assert np.isfinite(result.gaussians.position).all()


def test_moments_of_other_arrays_are_left_alone(scene):
    """A parameter that is not per Gaussian keeps its moments; so do all step counters."""
    gaussians, adam, statistics = scene
    adam.first["exposure_bias"] = adam.second["exposure_bias"] = np.arange(12.0).reshape(3, 4)
    adam.step["exposure_bias"] = 7
    other, steps = adam.first["exposure_bias"], dict(adam.step)
    plan = densify(gaussians, statistics, CONFIG, np.random.default_rng(5), EXTENT).plan
    regather(adam, arrays(gaussians), plan.source, plan.survivors)
    assert adam.first["exposure_bias"] is other is adam.second["exposure_bias"] and adam.step == steps
    assert adam.first["position"].shape == (3, 7)


def test_a_budget_at_most_doubles_the_number(rng):
    """Each candidate adds one Gaussian, so a budget with more room than candidates does not reach `maximum`."""
    gaussians, adam = make(rng, 12)
    gaussians.opacity_logit[:] = 0.0
    statistics = empty_statistics(12)
    statistics.visits[:], statistics.gradient_sum[:] = 1, 1e-9
    budget = msgspec.structs.replace(CONFIG, growth="budget", maximum=1000)
    assert run(gaussians, adam, statistics, budget, remaining=1).gaussians.count == 24
