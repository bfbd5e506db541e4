"""Decisions of other programs and other thresholds are found again, and nothing else is taken for one.

The mistakes are those of `habits.toml`; `python tests/port/search/habits.py` judges all of them.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from habits import EVERY, GOLDEN, MISTAKES, sentences_on

from endotsr.port.search.conventions import Convention, prepared
from endotsr.port.search.decisions import Interval, threshold
from endotsr.port.search.images import OF_IMAGES
from endotsr.port.search.screen import OF_THE_SCREEN
from endotsr.port.stages.definition import definition_stages

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "port.md"
CONVENTIONS = (*OF_THE_SCREEN, *OF_IMAGES)
FOUND = {
    "three_sigma_ellipse": "the ellipse of 3 sigma",
    "tiles_of_8": "tiles of 8 pixels, not of 16",
    "radius_not_rounded": "the radius of the tiles not rounded up",
    "frustum_of_1.3": "1.3 times the field of view",
    "quaternion_xyzw": "quaternions written x, y, z, w",
    "ssim_reflect": "the image mirrored under the window",
    "ssim_unbiased": "unbiased variances and covariance, times 121 / 120",
    "pyr_up_without_factor": "as pyrUp does, without the factor 4",
    "reverse_weight_not_decayed": "not dimmed by it",
    "reverse_own_included": "including the Gaussian itself",
}
ONE_OF_ALL = {  # operation, edits, words
    "depth": (
        "composite", [["image, far, sum_ = np.zeros((3, height, width)), np.zeros((height, width)), np.zeros((height,"
                       " width))", "image, far, sum_ = np.zeros((3, height, width)), *np.zeros((2, height, width))\n"
                       "    most = 0 * far"],
                      ["far += weight * depth[n]",
                       "far = np.where(weight > most, depth[n], far)\n        most = np.maximum(weight, most)"]],
        "the depth of the Gaussian of the largest weight",
    ),
    "picture": (
        "registration", [["1 - 2.5 * a**2 + 1.5 * a**3", "2 / 3 - a**2 + a**3 / 2"],
                         ["2 - 4 * a + 2.5 * a**2 - 0.5 * a**3", "(2 - a)**3 / 6"],
                         ["-5 * a + 4.5 * a**2", "-2 * a + 1.5 * a**2"],
                         ["-4 + 5 * a - 1.5 * a**2", "-(2 - a)**2 / 2"]],
        "the picture read by the cubic B-spline",
    ),
}  # fmt: skip
OTHERS = {  # mistakes that are no convention of the lists, and none may be said of them
    "composite": ("dx, dy = columns - mean[0, n]", "dx, dy = 1.01 * (columns - mean[0, n])"),
    "masked_ssim": ("a1, a2 = 2 * mu_x * mu_y + C1", "a1, a2 = 2 * mu_x * mu_y * (1 + 0.01 * mu_x) + C1"),
    "laplacian": ("coarse = down[0] @ level @ down[1].T", "coarse = 0.99 * down[0] @ level @ down[1].T"),
}  # fmt: skip


def test_every_convention_fits_the_definition_and_is_said_once():
    definition_stages()
    said = [prepared(convention).said for convention in CONVENTIONS]
    assert len(set(said)) == len(CONVENTIONS) >= 60


def test_a_convention_whose_text_is_gone_is_an_error():
    definition_stages()
    with pytest.raises(ValueError, match=r"0 places in masked_ssim\.blurred, where 1 is expected: 'no such text'"):
        prepared(Convention("nothing", (("masked_ssim.blurred", "no such text", ""),)))


@pytest.mark.parametrize("name", FOUND)
def test_a_convention_is_said_in_words_with_its_line(name):
    said = sentences_on(MISTAKES[name])
    assert FOUND[name] in said[0] and ", definition/" in said[0], said
    assert said[-1].startswith("  (every "), said


@pytest.mark.parametrize("what", ONE_OF_ALL)
def test_another_depth_or_kernel_is_said_in_words(what):
    operation, edit, words = ONE_OF_ALL[what]
    said = sentences_on({"operation": operation, "edit": edit})
    assert words in said[0], said


def test_another_threshold_is_said_with_its_interval():
    said = sentences_on(MISTAKES["cutoff_1_over_200"])
    (text,) = re.findall(r"raster\.alpha_cutoff fixed at 0\.005 \(any number from 0\.00.*?\)", said[0])
    assert text in " ".join(GUIDE.read_text("utf-8").split()), "docs/guides/port.md, A decision at another threshold"


@pytest.mark.parametrize("operation", OTHERS)
def test_another_mistake_has_none_of_these_names(operation):
    said = " ".join(sentences_on({"operation": operation, "edit": [OTHERS[operation]]}, seconds=2.0))
    assert not any(convention.said in said for convention in CONVENTIONS), said


def test_a_threshold_is_narrowed_by_counts():
    values = np.random.default_rng(0).uniform(0, 1, 1000)
    found = threshold(lambda k: int(((values > k) != (values > 0.3)).sum()), 0.5)
    assert found is not None and found.low <= 0.3 <= found.high
    assert not ((values > found.low) & (values <= found.high)).any() and 0.3 in found.numbers()
    assert threshold(lambda k: 7, 0.5) is None
    assert Interval(0.0039, 0.00391).numbers()[0] == 1 / 256


def test_the_set_has_every_kind_and_fits_the_port():
    assert len(MISTAKES) >= 60 and {one["operation"] for one in EVERY} <= {case.operation for case in GOLDEN.cases}
