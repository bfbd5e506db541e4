"""Intrinsics that cannot be those of the pictures: exchanged numbers, another picture size, a lens that folds."""

import numpy as np
import pytest

from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.prepare.lens import folded_fraction
from endotsr.clips.sequences.checks.cameras import intrinsics_findings


@pytest.mark.parametrize(("size", "centre", "said"), [
    ((640, 512), (320.0, 256.0), False), ((640, 512), (256.0, 320.0), True), ((1280, 1024), (560.0, 540.0), False),
    ((1280, 1024), (540.0, 610.0), True), ((1920, 1080), (872.0, 472.0), False), ((512, 512), (190.0, 256.0), False),
])  # fmt: skip
def test_exchanged_numbers_of_the_principal_point_are_named(size, centre, said):
    found = intrinsics_findings(Intrinsics(569.0, 569.0, *centre, *size), "here")
    assert ["exchanged" in finding.what for finding in found] == [True] * said


@pytest.mark.parametrize(("centre", "factor"), [
    ((640.0, 512.0), ""), ((597.5, 520.9), ""), ((540.0, 430.0), ""), ((320.0, 256.0), "0.5"),
    ((426.7, 341.3), "0.667"), ((960.0, 768.0), "1.5"), ((1280.0, 1024.0), "2"), ((320.0, 512.0), ""),
])  # fmt: skip
def test_a_principal_point_of_another_picture_size_is_named_with_the_size(centre, factor):
    lens = Intrinsics(1035.0, 1035.0, centre[0], centre[1], 1280, 1024)
    (what,) = [found.what for found in intrinsics_findings(lens, "")] or [""]
    assert (f"the centre of pictures of {factor} times this size" in what) == bool(factor)
    assert bool(what) == bool(factor)


def test_a_lens_model_turns_back_where_its_derivative_is_zero():
    matrix = np.array([[100.0, 0, 64], [0, 100, 48], [0, 0, 1]])
    radius = np.hypot(*np.meshgrid(np.arange(128) - 64, np.arange(96) - 48)) / 100
    for k1 in (-0.9, -0.6):
        expected = (radius > np.sqrt(-1 / (3 * k1))).mean()  # 1 + 3 k1 r^2 = 0
        assert folded_fraction(matrix, np.array([k1, 0, 0, 0]), 128, 96) == pytest.approx(expected, abs=5e-3)
    for right in ([-0.3, 0.1, 0, 0], [0.2, 0, 0, 0, 0.1], [-0.4, 0.2, 0, 0, 0, 0.1, 0, 0], [0, 0, 0.9, 0.9]):
        assert folded_fraction(matrix, np.array(right), 128, 96) == 0
