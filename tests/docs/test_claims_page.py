"""The page of claims: what it says is what the results say, and a verdict needs numbers."""

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from pages.claims import page as claims
from pages.claims.parts import planned_hours, protocols, tables
from pages.claims.power import least_size, pairs_needed
from pages.claims.protocols import MOVED, right_eye
from pages.claims.verdicts import NOT_YET, increment_verdict, level_verdict, student, verdicts
from pages.store.marks import replaced
from scipy import stats

from endotsr.cli.ablate import AblateOptions
from endotsr.cli.parts.fields import fields_of
from endotsr.studies.sweeps.ablation_page import ablation_record


@pytest.mark.parametrize("page", [claims.PAGE, claims.GUIDE], ids=lambda page: page.name)
def test_committed_pages_are_what_the_results_say(page):
    text = page.read_text(encoding="utf-8")
    assert "<!-- claims:" in text and replaced(text, claims.parts(), page, "claims") == text


def test_every_ablation_is_drawn_on_the_page(tmp_path):
    for name in claims.FILES:
        record = claims.RESULTS / claims.FILES[name]
        assert f"](results/{record.stem}.svg)" in claims.PAGE.read_text(encoding="utf-8")
        assert record.with_suffix(".svg").exists()
    (tmp_path / claims.FILES["pulling"]).write_text(json.dumps(made_up_record(0.28)), encoding="utf-8")
    claims.draw_ablations(tmp_path)
    assert [path.name for path in tmp_path.glob("*.svg")] == ["ablation_pulling.svg"]


def test_without_results_every_claim_says_so():
    text = verdicts(None, [], [])
    rows = [line for line in text.splitlines()[2:]]
    assert len(rows) == 22 and sum(NOT_YET in row for row in rows) == 15
    assert "not testable" in rows[-8] and all("not measured" in row for row in rows[-7:-1])
    assert tables(None) == protocols([None], []) == NOT_YET


@pytest.mark.parametrize(
    "published, low, high, pairs, verdict",
    [
        (0.29, 0.2, 0.4, 3, "reproduced"),
        (0.29, 0.2, 0.4, 2, "not decided: 2 of 3 seeds"),
        (0.29, None, None, 3, "not decided: 3 of 3 seeds"),
        (0.29, -0.1, 0.4, 3, "not decided: the interval contains 0 too"),
        (0.29, -0.1, 0.2, 3, "not reproduced"),
        (0.29, 0.4, 0.5, 3, "direction reproduced, size not"),
        (0.29, -0.4, -0.2, 3, "not reproduced: the opposite"),
        (0.0, -0.005, 0.009, 3, "reproduced"),
        (0.0, -0.05, 0.02, 3, "not decided: the interval is wider"),
        (0.0, 0.02, 0.05, 3, "not reproduced"),
    ],
)
def test_verdicts_of_differences(published, low, high, pairs, verdict):
    assert increment_verdict(published, low, high, pairs) == verdict


def test_verdicts_of_levels():
    assert level_verdict(39.34, 39.0, 39.5, True, 0.01) == level_verdict(39.34, 40.0, 41.0, True, 0.01) == "reproduced"
    assert level_verdict(39.34, 38.0, 39.0, True, 0.01) == "not reproduced"
    assert level_verdict(0.035, 0.03, 0.04, False, 0.001) == "reproduced"
    assert level_verdict(0.035, 0.04, 0.05, False, 0.001) == "not reproduced"
    assert level_verdict(39.34, None, None, True, 0.01) == "not decided: one seed"


@pytest.mark.parametrize("high, verdict", [(0.9664, "not reproduced"), (0.9666, "reproduced")])
def test_a_published_level_is_known_to_its_last_digit(high, verdict):
    assert level_verdict(0.967, 0.96, high, True, 0.001) == verdict
    mean, low, high = student([39.0, 39.2, 39.4])
    assert mean == pytest.approx(39.2) and high - low == pytest.approx(2 * 4.30265 * 0.2 / 3**0.5, rel=1e-5)


def made_up_record(gain: float) -> dict:
    """An ablation of two configurations and three seeds."""
    rows = []
    for seed in range(3):
        for name, psnr in (("S", 38.0 + seed), ("A+S", 38.0 + seed + gain + 0.01 * seed)):
            rows.append({
                "name": f"{name}{seed}", "sequence": "pulling", "split": "every_eighth", "configuration": name,
                "seed": seed, "status": "finished", "psnr_full": psnr, "psnr_tissue": psnr - 1.8, "ssim_full": 0.96,
                "iterations": 6000, "preset": "paper", "gaussians": 60000,
                "arrays_sha256": {"images": "a"}, "seconds": 600.0, "threads": 1,
            })  # fmt: skip
    return json.loads(json.dumps(ablation_record(rows, ["endotsr", "ablate"])))


def test_a_measured_claim_has_verdict_number_and_interval():
    line = row_of(verdicts(made_up_record(0.28), [], []), "Temporal appearance improves")
    assert "| A+S - S | +0.29 dB, mean over EndoNeRF | reproduced | +0.290 dB | +0.265 to +0.315 dB |" in line
    line = row_of(verdicts(made_up_record(-0.5), [], []), "Temporal appearance improves")
    assert "| not reproduced: the opposite |" in line
    assert "6 of 6 runs" in tables(made_up_record(0.28))


def half_record(gains: list[float]) -> dict:
    """Base and whole method, one seed a gain: frames 1, 3, ... held out, and the right camera 1 dB lower."""
    rows = []
    for seed, gain in enumerate(gains):
        for name, psnr in (("base", 36.0 + seed), ("A+S+L", 36.0 + seed + gain)):
            right = {"label": "this model", "held_out_psnr": psnr - 1, "training_psnr": 30.0}
            moved = {"label": MOVED, "training_psnr": 33.0}
            rows.append({
                "name": f"{name}{seed}", "sequence": "pulling", "split": "every_second", "configuration": name,
                "seed": seed, "psnr_full": psnr, "iterations": 3500, "preset": "paper", "width": 320, "height": 256,
                "arrays_sha256": {}, "measures": {"right_view": {"rows": [moved, right]}},
            })  # fmt: skip
    return {"rows": rows}


@pytest.mark.parametrize("gains, verdict", [([0.2, 0.3, 0.4], "gains"), ([-0.2, -0.3, -0.4], "loses"),
                                            ([-0.1, 0.1, 0.2], "not decided: the interval contains 0"),
                                            ([0.3, 0.4], "not decided: 2 of 3 seeds")])  # fmt: skip
def test_other_frames_are_decided_without_a_published_value(gains, verdict):
    """Against SciPy; the right camera at held-out times has the same differences, at training times none."""
    table = verdicts(None, [half_record(gains)], [])
    low, high = stats.ttest_1samp(gains, 0.0).confidence_interval(0.95)
    shown = f"{low:+.2f} to {high:+.2f} dB" if len(gains) > 2 else "-"
    for words in ("Every second frame", "The view of the right eye, at held-out"):
        line = row_of(table, words)
        assert "| A+S+L - base, 320x256, 3500 iterations | not at hand |" in line
        assert f"| {verdict} | {np.mean(gains):+.2f} dB | {shown} |" in line
    assert "+0.00 dB" in row_of(table, "The view of the right eye, at training")
    assert "not measured" in row_of(table, "Blocks of 2")
    assert "`base` 30.00 dB, `A+S+L` 30.00 dB, left picture moved" in right_eye(half_record(gains))
    assert right_eye(half_record(gains)).endswith("33.00 dB.") and "not measured" in right_eye(None)


def test_what_the_page_says_of_the_right_camera():
    """A gain in every seed for the trained view, none for the other, and the moved left picture ahead of both."""
    half = json.loads((claims.RESULTS / claims.FILES["pulling_half"]).read_text(encoding="utf-8"))
    gains = next(r for r in half["increments"] if r["metric"] == "psnr_full")["of"]
    assert all(pair["difference"] > 0 for pair in gains)
    row = row_of(claims.parts()["verdicts"], "The view of the right eye, at held-out")
    assert "not decided" in row and row.endswith("| 0.10 dB |")
    base, whole, moved = map(float, re.findall(r"([\d.]+) dB", right_eye(half)))
    assert moved > max(base, whole)


def row_of(table: str, words: str) -> str:
    """The row of a table that begins with the words."""
    return next(line for line in table.splitlines() if line.startswith(f"| {words}"))


def psnr(record: dict, name: str) -> np.ndarray:
    """PSNR full of the stored runs of a configuration, in the order of the seeds."""
    runs = sorted((row for row in record["rows"] if row["configuration"] == name), key=lambda row: row["seed"])
    return np.array([row["psnr_full"] for row in runs])


@pytest.mark.parametrize(
    "words, with_, without",
    [("Spectral motion", "S", "base"), ("Temporal appearance", "A+S", "S"), ("Laplacian detail", "A+S+L", "A+S"),
     ("With a fixed number", "A+S+L fixed", "S fixed"), ("The Matérn prior", "S", "S without prior"),
     ("The same with a fixed", "S fixed", "S without prior fixed")],
)  # fmt: skip
def test_a_claim_is_about_the_pair_of_the_paper(words, with_, without):
    """The page against SciPy on the stored runs: the pairs stand here once more, apart from the code."""
    record = json.loads((claims.RESULTS / claims.FILES["pulling"]).read_text(encoding="utf-8"))
    difference = psnr(record, with_) - psnr(record, without)
    low, high = stats.ttest_1samp(difference, 0.0).confidence_interval(0.95)
    line = row_of(claims.parts()["verdicts"], words)
    assert f"| {with_} - {without} |" in line
    assert f"| {difference.mean():+.3f} dB | {low:+.3f} to {high:+.3f} dB |" in line


@pytest.mark.parametrize("pairs", [2, 3, 5, 12])
def test_the_power_of_the_test_is_what_a_simulation_finds(pairs):
    """20 000 trials of normal differences at the size that is said to be seen in four of five."""
    size = least_size(pairs)
    drawn = np.random.default_rng(pairs).normal(size, 1.0, (20_000, pairs))
    low, high = stats.ttest_1samp(drawn, 0.0, axis=1).confidence_interval(0.95)
    assert np.mean((low > 0) | (high < 0)) == pytest.approx(0.8, abs=0.01)
    assert pairs_needed(size * 1.001) == pairs


@pytest.mark.parametrize("low, high, verdict", [(0.2, 0.4, "reproduced"), (0.7, 0.9, "direction reproduced, size not"),
                                                (-0.1, 0.4, "not decided: the interval contains 0 too"),
                                                (-0.1, 0.2, "not reproduced")])  # fmt: skip
def test_a_published_range_is_met_or_not(low, high, verdict):
    assert increment_verdict(0.31, low, high, 3, 0.66) == verdict == increment_verdict(0.66, low, high, 3, 0.31)


def test_the_largest_step_is_one_of_the_cumulative_ones():
    record = json.loads((claims.RESULTS / claims.FILES["pulling"]).read_text(encoding="utf-8"))
    names = ("base", "S", "A+S", "A+S+L")
    steps = [(psnr(record, b) - psnr(record, a)).mean() for a, b in pairwise(names)]
    wanted = "| S {:+.3f}, A {:+.3f}, L {:+.3f} dB |".format(*steps)
    assert wanted in row_of(claims.parts()["verdicts"], "Temporal appearance is the largest")


@pytest.mark.parametrize("path", claims.FILES.values())
def test_the_stored_differences_are_those_of_the_stored_runs(path):
    record = json.loads((claims.RESULTS / path).read_text(encoding="utf-8"))
    again = json.loads(json.dumps(claims.compared(record)))
    assert again["increments"] == record["increments"] and again["levels"] == record["levels"]


@pytest.mark.parametrize("path", claims.FILES.values())
def test_differences_on_tissue_are_those_of_the_whole_image(path):
    record = json.loads((claims.RESULTS / path).read_text(encoding="utf-8"))
    of = {(r["claim"], r["split"], r["metric"]): r["mean"] for r in record["increments"]}
    whole = {key[:2]: mean for key, mean in of.items() if key[2] == "psnr_full"}
    assert whole and all(abs(of[*key, "psnr_tissue"] - mean) < 1e-9 for key, mean in whole.items())


def test_lpips_has_a_verdict_for_each_range_of_its_input():
    table = claims.parts()["verdicts"]
    rows = [row_of(table, f"LPIPS, if its input is in {where}") for where in ("[0, 1]", "[-1, 1]")]
    record = json.loads((claims.RESULTS / claims.FILES["pulling"]).read_text(encoding="utf-8"))
    level = next(level for level in record["levels"] if level["configuration"] == "A+S+L")
    assert f"| {level['lpips']:.4f}, 3 seeds |" in rows[0] and f"| {level['lpips_symmetric']:.4f}, 3 seeds |" in rows[1]


def test_the_rules_stand_before_the_numbers():
    text = claims.PAGE.read_text(encoding="utf-8")
    assert text.index("**Reproduced**") < text.index("<!-- claims:verdicts:start -->")


def test_what_the_paper_does_not_compare_is_marked_as_ours():
    table = claims.parts()["pulling"]
    rows = [line for line in table.splitlines() if "| PSNR full, dB |" in line]
    ours = {line.split(" | ")[0].removeprefix("| ") for line in rows if line.split(" | ")[-2] == "-"}
    assert ours and all(name.endswith(" (ours)") for name in ours) and "A alone (ours)" in ours
    assert sum("(ours)" in line for line in rows) == len(ours)


def test_hours_follow_the_model():
    assert planned_hours(15, 2, 30.0, begin=0.0) == pytest.approx(8 * 30 / 60)
    assert planned_hours(15, 4, 30.0, threads=2, begin=0.0) == pytest.approx(8 * 15 / 60)
    assert planned_hours(15, 64, 30.0, begin=1.0) == pytest.approx(31 / 60)
    assert planned_hours(0, 2, 30.0) == 0.0
    with pytest.raises(ValueError, match="no worker"):
        planned_hours(3, 1, 30.0, threads=2)


def test_the_commands_of_the_page_have_the_options_that_exist():
    text = claims.PAGE.read_text(encoding="utf-8") + claims.GUIDE.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("endotsr ablate ")]
    names = {field.name for field in fields_of(AblateOptions)}
    assert lines and all(word in names for line in lines for word in line.split() if word.startswith("--"))
