"""The answer of the claims and the sentences beside it: none says more than its records, whatever they hold."""

import json
import re

import pytest
from pages.bench import minutes
from pages.claims import page as claims
from pages.claims.answer import _cells, _stands, splits, with_other_weights
from pages.claims.estimates import Estimate, contrast
from pages.claims.rules import LEAST_PAIRS
from pages.claims.verdicts import CLIPS
from pages.full_size import record


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    return claims.parts()


def test_the_answer_has_both_verdicts_where_they_differ():
    """The interval of three seeds alone, and that with the spread of all configurations: one may decide."""
    apart = Estimate((0.2, 0.3, 0.5), 0.33, 0.3, (-0.05, 0.71), (0.2, 0.47))
    open_, reproduced = "not decided: the interval contains 0 too", "reproduced"
    assert _cells(apart, 0.31, 0.66) == ["+0.33", "-0.05 to +0.71", open_, "+0.20 to +0.47", reproduced]
    assert _cells(apart._replace(common=(-0.1, 0.7)), 0.31, 0.66)[3:] == ["-0.10 to +0.70", open_]
    one = apart._replace(values=(0.2,), paired=None, common=None)
    assert _cells(one, 0.31, 0.66)[1:] == ["-", "not decided: 1 of 3 seeds"] * 2


def test_the_answer_counts_every_measured_combination_and_names_the_shorter_runs(made):
    """Each size and length by itself; the combinations are those of the table of other held-out frames."""
    row = {
        "configuration": "A+S+L", "sequence": "clip", "split": "every_eighth", "width": 640, "height": 512,
        "iterations": 6000, "psnr_tissue": 37.0, "baselines": {"two_neighbours": {"mean": {"psnr_tissue": 38.0}}},
    }  # fmt: skip
    short = [row | {"split": "end 8", "iterations": 3000, "psnr_tissue": 39.0},
             row | {"width": 320, "height": 256, "iterations": 1750}]  # fmt: skip
    assert splits({"pulling": {"rows": [row]}}, [{"rows": short}, None]) == (
        "The mean of the full method is below the blend in 2 of the 3 combinations of clip, size and held-out frames "
        "measured, 1 of them at 320x256 with 1750 iterations, 1 of them at 640x512 with 3000 iterations."
    )
    pairs = splits({"pulling": {"rows": [row | {"sequence": "pulling_pairs"}]}}, [])
    assert pairs.endswith("One clip of them is `pulling_pairs`, which is pulling without its last frame.")
    rows = [line.strip("| ").split(" | ") for line in made["protocols"].splitlines() if ", paper" in line]
    below = sum(float(cells[4]) < float(cells[6]) for cells in rows)
    assert f"below the blend in {below} of the {len(rows)} combinations" in made["answer"]


def test_a_published_level_of_the_answer_is_known_to_its_last_digit():
    """As in the verdicts: 39.34 stands for all values that round to it."""
    assert [_stands(limits, 39.34) for limits in ((39.0, 39.336), (39.344, 39.5))] == ["lies in the interval"] * 2
    assert [_stands(limits, 39.34) for limits in ((39.0, 39.33), (39.35, 39.5))] == ["is not reached", "is exceeded"]


def test_a_published_level_is_shown_with_the_digits_of_the_paper(made):
    for name, ssim in (("pulling", "0.967"), ("cutting", "0.980")):
        assert f"| Level: SSIM | A+S+L | {ssim} |" in made[f"verdicts_{name}"]
        assert f" | {ssim} | " in next(
            row for row in record.every_clip().splitlines() if f"published, EndoNeRF {name}" in row
        )
    assert next(row for row in minutes.table(minutes.PROGRAM.read()).splitlines() if "published" in row).endswith(
        "| 39.34 | 0.967 | 0.035 |"
    )


def test_what_the_page_says_of_the_prior():
    """Every interval of PSNR has 0 and exceeds 0.01 dB; what is resolved in SSIM and LPIPS is below a thousandth."""
    for name in CLIPS:
        found_runs = json.loads((claims.RESULTS / claims.FILES[name]).read_text(encoding="utf-8"))
        for terms in ({"S": 1, "S without prior": -1}, {"S fixed": 1, "S without prior fixed": -1}):
            for metric in ("psnr_full", "ssim_tissue", "lpips", "lpips_symmetric"):
                if (found := contrast(found_runs, terms, metric)) is None:
                    continue
                low, high = found.paired
                if metric == "psnr_full":
                    assert low < 0 < high and max(-low, high) > 0.01
                else:
                    assert low < 0 < high or abs(found.mean) < 0.001


def test_the_sentence_of_the_power_names_its_clip(made):
    said = made["power"]
    assert "spread of EndoNeRF pulling, 3 seeds" in said and "most likely" not in said
    needed = [int(count) for count in re.findall(r" dB: (\d+)", said)]
    assert len(needed) == 5 and min(needed) == LEAST_PAIRS == 3, "with fewer there is no verdict"


def test_the_answer_names_the_level_with_other_weights_of_ssim():
    weights = ((0.0, 38.0), (0.05, 38.5), (0.1, 39.0), (0.2, 39.3), (0.4, 40.0))
    rows = [
        {"configuration": f"w {weight}", "sequence": "endonerf_pulling", "psnr_full": level + step}
        for weight, level in weights
        for step in (-0.05, 0.0, 0.05)
    ]
    said = with_other_weights(rows)
    assert "weight 0.1 of D-SSIM" in said
    assert " With 0.0 (38.00 dB, 37.88 to 38.12 dB) and 0.05 (38.50 dB, " in said
    for told in ("it is not reached", "it lies in the interval", "it is exceeded"):
        assert f" dB) {told} on pulling." in said
    assert "0.1 (" not in said and with_other_weights(rows[:2]) == with_other_weights([]) == ""
