"""Decisions of other programs and other thresholds are found again, and nothing else is taken for one.

The mistakes are those of `conventions.toml`.
"""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from searched import search_on

from endotsr.port.operations.definition import definition_operations
from endotsr.port.search.conventions import Convention, prepared
from endotsr.port.search.decisions import Interval, threshold
from endotsr.port.search.find import sentences
from endotsr.port.search.images import OF_IMAGES
from endotsr.port.search.screen import OF_THE_SCREEN

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "port.md"
FOUND = tomllib.loads(Path(__file__).with_name("conventions.toml").read_text("utf-8"))
CONVENTIONS = (*OF_THE_SCREEN, *OF_IMAGES)
CUTOFF = ('drawn = open_ & (alpha >= raster["alpha_cutoff"])', "drawn = open_ & (alpha >= 0.005)")
OTHERS = {  # mistakes that are no convention of the lists, and none may be said of them
    "composite": ("dx, dy = columns - mean[0, n]", "dx, dy = 1.01 * (columns - mean[0, n])"),
    "masked_ssim": ("a1, a2 = 2 * mu_x * mu_y + C1", "a1, a2 = 2 * mu_x * mu_y * (1 + 0.01 * mu_x) + C1"),
    "laplacian": ("coarse = down[0] @ level @ down[1].T", "coarse = 0.99 * down[0] @ level @ down[1].T"),
}  # fmt: skip


def test_every_convention_fits_the_definition_and_is_said_once():
    definition_operations()
    said = [prepared(convention).said for convention in CONVENTIONS]
    assert len(set(said)) == len(CONVENTIONS) >= 60


def test_a_convention_whose_text_is_gone_is_an_error():
    definition_operations()
    with pytest.raises(ValueError, match=r"0 places in masked_ssim\.blurred, where 1 is expected: 'no such text'"):
        prepared(Convention("nothing", (("masked_ssim.blurred", "no such text", ""),)))


@pytest.mark.parametrize("name", FOUND)
def test_a_convention_is_said_in_words_with_its_line(name, golden, tmp_path):
    entry = FOUND[name]
    said = sentences(search_on(golden, tmp_path, entry["operation"], *entry["edit"], seconds=8.0))
    assert entry["says"] in said[0] and ", definition/" in said[0], said
    assert said[-1].startswith("  (every "), said


def test_another_threshold_is_said_with_its_interval(golden, tmp_path):
    said = sentences(search_on(golden, tmp_path, "composite", CUTOFF, seconds=8.0))
    (text,) = re.findall(r"raster\.alpha_cutoff fixed at 0\.005 \(any number from 0\.00.*?\)", said[0])
    assert text in " ".join(GUIDE.read_text("utf-8").split()), "docs/guides/port.md, A decision at another threshold"


@pytest.mark.parametrize("operation", OTHERS)
def test_another_mistake_has_none_of_these_names(operation, golden, tmp_path):
    said = " ".join(sentences(search_on(golden, tmp_path, operation, OTHERS[operation], seconds=2.0)))
    assert not any(convention.said in said for convention in CONVENTIONS), said


def test_a_threshold_is_narrowed_by_counts():
    values = np.random.default_rng(0).uniform(0, 1, 1000)
    found = threshold(lambda k: int(((values > k) != (values > 0.3)).sum()), 0.5)
    assert found is not None and found.low <= 0.3 <= found.high
    assert not ((values > found.low) & (values <= found.high)).any() and 0.3 in found.numbers()
    assert threshold(lambda k: 7, 0.5) is None
    assert Interval(0.0039, 0.00391).numbers()[0] == 1 / 256
