"""The flexible deformation model, equation (B1), against its definition and on its hard cases F1-F9."""

import numpy as np
import pytest

from endotsr.definition import deformation as definition
from endotsr.method.equations.deformation import (
    BASES,
    GAUSSIAN_REACH,
    QUARTIC_REACH,
    deformation_forward,
    deformation_reverse,
)
from endotsr.method.equations.deformation import GAUSSIANS_PER_PIECE as PIECE
from endotsr.method.equations.deformation import GAUSSIANS_PER_STRETCH as STRETCH
from method.by_threads import assert_threads_change_no_bit

UNIT = {"float32": 2.0**-24, "float64": 2.0**-53}


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def arrays(rng, bases=4, count=7, dtype=np.float64):
    shape = (10, bases, count)
    weight = rng.uniform(-1, 1, shape)
    centre = rng.uniform(-0.1, 1.1, shape)
    width = rng.uniform(-0.3, 0.3, shape)
    return tuple(a.astype(dtype) for a in (weight, centre, width))


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_values_equal_the_definition(rng, basis, dtype):
    """8 u a basis value of absolute weight at most 1, summed over B bases: 8 B u."""
    weight, centre, width = arrays(rng, dtype=dtype)
    out, _ = deformation_forward(weight, centre, width, 0.375, basis)
    truth, _ = definition.deformation_forward(*(a.astype(np.float64) for a in (weight, centre, width)), 0.375, basis)
    assert out.dtype == dtype
    assert np.abs(truth).max() > 0.3
    assert np.abs(out - truth).max() <= 8 * weight.shape[1] * UNIT[dtype]


def test_hard_F1_the_two_bases_are_told_apart():
    """At distance 0.02 and width 0.01 the quartic basis is exp(-4), the Gaussian exp(-1)."""
    one = np.ones((10, 1, 1))
    values = {b: deformation_forward(one, 0.5 * one, 0.01 * one, 0.52, b)[0][0, 0] for b in BASES}
    assert values["quartic"] == pytest.approx(np.exp(-4.0), rel=1e-12)
    assert values["gaussian"] == pytest.approx(np.exp(-1.0), rel=1e-12)
    with pytest.raises(ValueError, match=r"basis.*quartic, gaussian"):
        deformation_forward(one, one, one, 0.5, "gauss")  # type: ignore[arg-type]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("basis", BASES)
def test_hard_F2_F3_width_zero_is_finite_and_stuck(rng, basis, dtype):
    weight, centre, width = arrays(rng, dtype=dtype)
    width = np.zeros_like(width)
    out, saved = deformation_forward(weight, centre, width, 0.4, basis)
    grads = deformation_reverse(rng.normal(size=out.shape).astype(dtype), saved)
    assert np.isfinite(out).all()
    assert all(np.isfinite(g).all() for g in grads[:3])
    assert (grads.d_fdm_width == 0).all()
    one = np.ones((10, 1, 1), dtype)
    on_centre, _ = deformation_forward(one, one / 2, width[:, :1, :1], 0.5, basis)
    assert (on_centre == 1).all()


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("basis", BASES)
def test_hard_F4_F9_zero_weights_keep_the_pose_bitwise_and_stop_the_gradient_of_centre_and_width(rng, basis, dtype):
    weight, centre, width = arrays(rng, dtype=dtype)
    out, saved = deformation_forward(np.zeros_like(weight), centre, width, 0.4, basis)
    pose = rng.normal(size=out.shape).astype(dtype)
    np.testing.assert_array_equal((pose + out).view(np.uint8), pose.view(np.uint8))
    grads = deformation_reverse(np.ones_like(out), saved)
    assert (grads.d_fdm_centre == 0).all()
    assert (grads.d_fdm_width == 0).all()
    assert grads.d_t == 0
    assert (grads.d_fdm_weight != 0).any()


@pytest.mark.parametrize(("bases", "count"), [(1, 1), (0, 3), (2, 0), (17, 1), (1, PIECE + 1)])
def test_hard_F5_smallest_sizes(rng, bases, count):
    weight, centre, width = arrays(rng, bases, count)
    out, saved = deformation_forward(weight, centre, width, 0.4)
    grads = deformation_reverse(np.ones_like(out), saved)
    assert out.shape == (10, count)
    assert grads.d_fdm_weight.shape == weight.shape
    last = slice(max(count - 2, 0), None)
    truth, _ = definition.deformation_forward(weight[..., last], centre[..., last], width[..., last], 0.4)
    np.testing.assert_allclose(out[:, last], truth, rtol=0, atol=1e-14)


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("t", [-1.0, 2.0])
def test_hard_F6_far_outside_of_the_sequence_the_pose_is_canonical(rng, basis, t):
    weight = rng.normal(size=(10, 17, 3))
    centre = np.broadcast_to(np.linspace(0, 1, 17)[:, None], weight.shape).copy()
    out, _ = deformation_forward(weight, centre, np.full_like(weight, 0.05), t, basis)
    assert np.abs(out).max() <= 1e-12


def test_hard_F7_dead_frames_at_the_start():
    """17 quartic bases of width 0.01: 16 of 63 frames have no basis value above 1e-3. A fact, not an error."""
    centre = np.broadcast_to(np.linspace(0, 1, 17)[:, None], (10, 17, 17)).copy()
    weight = np.broadcast_to(np.eye(17), (10, 17, 17)).copy()  # Gaussian i shows basis i alone
    width = np.full_like(weight, 0.01)
    best = [deformation_forward(weight, centre, width, k / 63)[0][0].max() for k in range(63)]
    assert sum(b < 1e-3 for b in best) == 16
    wide = [deformation_forward(weight, centre, 5 * width, k / 63)[0][0].max() for k in range(63)]
    assert min(wide) > 0.8  # width 0.05, as in the presets other than `paper`


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_extreme_centres_and_widths_stay_finite(basis, dtype):
    centre = np.tile(np.array([1e30, -1e30, 1e15, 0.5, 1e3, np.finfo(dtype).max / 4], dtype), (10, 1, 1))
    width = np.tile(np.array([0.01, 1e25, 0.0, 1e30, 1e-30, 0.0], dtype), (10, 1, 1))
    out, saved = deformation_forward(np.ones_like(centre), centre, width, 0.5, basis)
    grads = deformation_reverse(np.ones_like(out), saved)
    assert np.isfinite(out).all()
    assert all(np.isfinite(g).all() for g in grads[:3])


@pytest.mark.parametrize("basis", BASES)
def test_bits_do_not_depend_on_threads(rng, basis):
    weight, centre, width = arrays(rng, 3, PIECE + 37, np.float32)
    d_offsets = rng.normal(size=(10, PIECE + 37)).astype(np.float32)

    def compute():
        out, saved = deformation_forward(weight, centre, width, 0.4, basis)
        return out, *deformation_reverse(d_offsets, saved)

    assert_threads_change_no_bit(compute)


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_stretches_that_no_basis_reaches_are_left_out_without_a_trace(rng, basis, dtype):
    """Column by column nothing is left out, since a stretch that is not full is always computed: the same bits.

    Most centres are far from t, so that whole stretches are out of reach, the first one among them. Some hold a single
    basis in reach, in the second, the first or the last place. Near the end of the reach a basis value is 2^-60: the
    bound must not come before it, for narrow and for wide bases, nor for a wide one among narrow ones. NaN is never
    out of reach.
    """
    count = 10 * STRETCH + 3
    weight, centre, width = arrays(rng, 2, count, dtype)
    reach = QUARTIC_REACH if basis == "quartic" else GAUSSIAN_REACH
    ends = np.repeat([1.5, 0.999, *np.linspace(1.001, 3.0, 7), 0.999, 2.0], STRETCH)[:count]
    widths = np.full(count, 0.01)
    widths[9 * STRETCH : 10 * STRETCH], widths[5 * STRETCH - 1], ends[5 * STRETCH - 1] = 3.0, 3.0, 0.999
    centre[:], width[:] = (0.4 + ends * np.sqrt(reach * (widths**2 + 1e-4))).astype(dtype), widths
    centre[:, :, 5 * STRETCH + 1], centre[:, :, 9 * STRETCH - 1], centre[2, 1, 7 * STRETCH] = 0.4, 0.4, np.nan
    d_offsets = rng.normal(size=(10, count)).astype(dtype)
    out, saved = deformation_forward(weight, centre, width, 0.4, basis)
    grads = deformation_reverse(d_offsets, saved)
    used = np.any(grads.d_fdm_weight != 0, axis=(0, 1)).reshape(-1)[: 10 * STRETCH].reshape(10, STRETCH).sum(axis=1)
    assert list(used) == [0, STRETCH, 0, 0, 1, 1, 0, 1, 1, STRETCH]
    assert np.isnan(out[2, 7 * STRETCH])
    for i in range(count):
        one, alone = deformation_forward(
            weight[..., i : i + 1], centre[..., i : i + 1], width[..., i : i + 1], 0.4, basis
        )
        np.testing.assert_array_equal(out[:, i : i + 1], one)
        for whole, single in zip(grads[:3], deformation_reverse(d_offsets[:, i : i + 1], alone)[:3], strict=True):
            np.testing.assert_array_equal(whole[..., i : i + 1], single)


def test_inputs_that_disagree_are_refused(rng):
    weight, centre, width = arrays(rng)
    with pytest.raises(ValueError, match="fdm_width"):
        deformation_forward(weight, centre, width[:, :1], 0.4)
    with pytest.raises(ValueError, match="fdm_centre"):
        deformation_forward(weight, centre.astype(np.float32), width, 0.4)
    with pytest.raises(ValueError, match="fdm_weight"):
        deformation_forward(weight[:9], centre[:9], width[:9], 0.4)
    _, saved = deformation_forward(weight, centre, width, 0.4)
    with pytest.raises(ValueError, match="d_offsets"):
        deformation_reverse(np.ones((10, 3)), saved)
