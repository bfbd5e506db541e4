"""The reverse passes of the definition: differences of its forward passes, complex steps, and wrong signs."""

import importlib

import numpy as np
import pytest

import house
from definition import signs
from endotsr.definition import compositing, laplacian, masked_ssim, pose
from endotsr.port.gradcheck import check_pair, definition_pairs, one_thread, pair_stream, table
from oracle.complex_step import derivative

pytestmark = pytest.mark.slow

PAIRS = definition_pairs()
# Whole renders, which take minutes: `endotsr gradcheck --definition` checks them too; here by complex steps and golden.
LONG = {"render_exact", "render_paper", "objective", "composite_exact", "composite_paper"}


@pytest.mark.parametrize("name", sorted(PAIRS.keys() - LONG))
def test_the_reverse_pass_is_the_derivative(name):
    pair = PAIRS[name]
    with one_thread():
        report = check_pair(pair, pair_stream(name, 0))
    assert report.passed, table([report])


def test_every_pair_is_checked_somewhere():
    assert LONG <= PAIRS.keys()
    assert {pair.function.rpartition(".")[0] for pair in PAIRS.values()} <= {
        f"endotsr.{name}" for name in house.modules() if house.room(name) == "definition"
    }


def test_a_series_and_a_pose_by_complex_steps():
    rng = np.random.default_rng(4)
    given, d_rotation, d_translation = rng.normal(size=(4, 3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    rotation, vector = given[0], given[1, 0]
    _, _, saved = pose.pose_forward(rotation, given[2, 0], vector, given[3, 0])
    found = pose.pose_reverse(d_rotation, d_translation, saved).d_rotation_vector

    def weighted(moved):
        turned, shifted, _ = pose.pose_forward(rotation, given[2, 0], moved, given[3, 0])
        return (d_rotation * turned).sum() + (d_translation * shifted).sum()

    np.testing.assert_allclose(found, derivative(weighted, vector), rtol=1e-13)


def test_what_a_sign_changes_is_noticed():
    """The first sign of a few files; all of them: python tests/definition/signs.py."""
    golden = signs.read_golden(signs.golden_folder())
    for name in ("deformation", "projection", "smoothness", "schedules"):
        wrong = signs.wrong_functions(importlib.import_module(f"endotsr.definition.{name}"))
        line, function, code = next(w for w in wrong if not w[0].startswith(tuple(signs.NOTICED_BY_NOBODY)))
        with signs.installed(function, code):
            assert any(signs.notices(golden, case) for case in signs.cases_for(golden, name)), (name, line)
        assert not signs.notices(golden, signs.cases_for(golden, name)[0]), "the right code stands again"


def test_masks_that_nothing_reaches_give_zero_and_no_warning():
    dark = np.zeros((4, 5), bool)
    loss, saved = masked_ssim.masked_ssim_forward(np.ones((3, 4, 5)), masked_ssim.ssim_target(np.ones((3, 4, 5)), dark))
    assert loss == 1.0 and not masked_ssim.masked_ssim_reverse(1.0, saved).any()
    masks = laplacian.support_masks(dark)
    loss, saved = laplacian.laplacian_loss_forward(np.full((3, 4, 5), np.nan), np.zeros((3, 4, 5)), masks)
    assert loss == 0.0 and not laplacian.laplacian_loss_reverse(1.0, saved).any()
    assert compositing.opacity_of(np.array([-800.0, 800.0])).tolist() == [0.0, 1.0]
