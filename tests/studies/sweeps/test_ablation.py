"""Paired differences: known numbers, equal weights, matched input, honest intervals."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from endotsr.errors import InputError
from endotsr.results.report import style
from endotsr.studies.sweeps.ablation import (
    BOTH,
    COMPARISONS,
    CONFIGURATIONS,
    FIXED,
    RunPair,
    ablation_spec,
    estimate,
    increments,
    levels,
    model_of,
    published_value,
)
from endotsr.studies.sweeps.ablation_page import (
    FILES,
    ablation_markdown,
    ablation_record,
    interval_text,
    write_ablation,
)
from endotsr.studies.sweeps.spec import StartAt, spec_of


def row(configuration, seed, psnr, sequence="one", split="every_eighth", **more):
    """A finished run."""
    name = f"{sequence}-{split}-{configuration}-seed{seed}"
    about = {"name": name, "sequence": sequence, "split": split, "configuration": configuration, "seed": seed}
    same = {"iterations": 30, "preset": "paper", "arrays_sha256": {"images": sequence}, "gaussians": 100 + seed}
    return about | same | {"status": "finished", "psnr_full": psnr, "psnr_tissue": psnr - 1.8, "lpips": None} | more


def open_row(configuration, seed):
    return row(configuration, seed, 0.0) | {"status": "open"}


def pairs(**groups):
    return [RunPair(name, k, v) for name, values in groups.items() for k, v in enumerate(values)]


def test_a_difference_is_paired_by_seed():
    """The levels of the seeds are far apart, the differences are not."""
    rows = [row("S", s, 30.0 + 5 * s) for s in range(3)] + [row("A+S", s, 30.2 + 5 * s + 0.1 * s) for s in range(3)]
    found = next(f for f in increments(rows) if f.metric == "psnr_full")
    assert found.comparison.claim == "A added to S" and found.input_recorded
    assert found.estimate.mean == pytest.approx(0.3) and found.estimate.median == pytest.approx(0.3)
    assert 0.199 <= found.estimate.mean_low < 0.3 < found.estimate.mean_high <= 0.401
    assert [p.seed for p in found.pairs] == [0, 1, 2]


def test_sequences_have_equal_weights_whatever_their_seeds():
    found = estimate(pairs(many=[1.0, 1.0, 1.0, 1.0, 1.0, 1.0], few=[0.0, 0.0]))
    assert found.mean == found.median == 0.5 and (found.pairs, found.sequences) == (8, 2)
    rows = [row("base", s, 30.0) for s in range(6)] + [row("base", s, 20.0, "two") for s in range(2)]
    assert levels(rows)[0]["psnr_full"] == 25.0 and levels(rows)[0]["runs"] == 8


def test_one_seed_has_no_interval():
    found = estimate(pairs(a=[0.4], b=[0.6, 0.8]))
    assert found.mean == pytest.approx(0.55) and found.mean_low is None and found.median_high is None
    assert found.student_low is None and found.student_high is None
    assert all(interval_text(found._asdict(), of, 2) == "-" for of in ("student", "mean", "median"))


def test_the_interval_is_that_of_the_seeds_within_each_sequence():
    """Two constant sequences that differ: seeds change nothing, so the interval is a point."""
    found = estimate(pairs(a=[1.0, 1.0, 1.0], b=[3.0, 3.0, 3.0]))
    assert (found.mean_low, found.mean_high) == (found.student_low, found.student_high) == (2.0, 2.0)


def test_the_bootstrap_of_many_seeds_covers_the_true_difference_about_as_often_as_it_says():
    rng, covered = np.random.default_rng(3), 0
    for k in range(60):
        found = estimate(pairs(a=list(rng.normal(0.2, 1.0, 20)), b=list(rng.normal(0.2, 1.0, 20))), seed=k)
        covered += found.mean_low <= 0.2 <= found.mean_high
    assert 50 <= covered <= 60


def test_the_bootstrap_of_three_seeds_is_their_range():
    """The reason why it decides nothing: the range of three values misses their median in a quarter of all cases."""
    found = estimate(pairs(a=[0.1, 0.5, 0.2]))
    assert (found.mean_low, found.mean_high) == pytest.approx((0.1, 0.5))
    assert (found.median_low, found.median_high) == pytest.approx((0.1, 0.5))


def test_students_interval_of_one_sequence_is_that_of_scipy():
    values = [0.31, 0.22, 0.41, 0.28]
    found, oracle = estimate(pairs(a=values)), stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert (found.student_low, found.student_high) == pytest.approx((oracle.low, oracle.high), rel=1e-12)


def test_students_interval_of_two_sequences_is_that_of_welch():
    """The sum of two means is the difference of the first and the negative second, which SciPy knows."""
    a, b = [0.31, 0.22, 0.41], [1.4, 0.9, 1.1, 1.6, 0.2]
    found = estimate(pairs(a=a, b=b))
    oracle = stats.ttest_ind(a, [-v for v in b], equal_var=False).confidence_interval(0.95)
    assert (found.student_low, found.student_high) == pytest.approx((oracle.low / 2, oracle.high / 2), rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(groups=st.lists(st.lists(st.floats(-2.0, 2.0, width=32), min_size=2, max_size=5), min_size=1, max_size=4))
def test_students_interval_holds_the_mean_and_is_finite(groups):
    found = estimate(pairs(**{f"s{k}": values for k, values in enumerate(groups)}))
    assert np.isfinite([found.student_low, found.student_high]).all()
    assert found.student_low <= found.mean + 1e-12 and found.mean <= found.student_high + 1e-12


@pytest.mark.parametrize("key, value", [("iterations", 31), ("preset", "sharp"), ("arrays_sha256", {"images": "x"})])
def test_runs_on_other_input_are_no_pair(key, value):
    with pytest.raises(InputError, match=f"differ in {key}"):
        increments([row("base", 0, 30.0), row("A", 0, 30.0, **{key: value})])


@pytest.mark.parametrize("without", ["base", "A"])
def test_a_run_of_which_the_input_is_not_recorded_is_refused_or_labelled(without):
    """Two missing hashes are equal as values; they show nothing about the files."""
    rows = [row("base", 0, 30.0), row("A", 0, 30.5)]
    for r in rows:
        if without == r["configuration"]:
            del r["arrays_sha256"]
    for missing in (rows, [row(c, 0, 30.0, arrays_sha256={}) for c in ("base", "A")]):
        with pytest.raises(InputError, match="seed0: arrays_sha256, the hashes of its input, is not recorded"):
            increments(missing)
        assert not any(found.input_recorded for found in increments(missing, unrecorded=True))
        assert "Input not recorded" in ablation_markdown(ablation_record(missing, [], unrecorded=True))
    assert "Input not recorded" not in ablation_markdown(ablation_record([row("base", 0, 1.0), row("A", 0, 2.0)], []))


def test_unrecorded_input_does_not_hide_another_difference():
    rows = [row("base", 0, 30.0, arrays_sha256={}), row("A", 0, 30.5, arrays_sha256={}, iterations=31)]
    with pytest.raises(InputError, match="differ in iterations"):
        increments(rows, unrecorded=True)
    with pytest.raises(InputError, match="differ in arrays_sha256"):
        increments([row("base", 0, 30.0), row("A", 0, 30.5, arrays_sha256={"images": "x"})], unrecorded=True)


def test_what_is_not_finished_is_no_pair():
    assert increments([row("base", 0, 30.0), open_row("A", 0), row("A", 1, 31.0)]) == []


def test_every_comparison_is_between_configurations_that_are_made():
    made = ablation_spec(["simulated"], 3, fixed_at=3000)["configurations"]
    named = {name for c in COMPARISONS for name in (c.with_, c.without)}
    assert named <= set(made) and set(CONFIGURATIONS) <= set(made)
    assert len(made) == 2 * len(CONFIGURATIONS)


def test_the_steps_of_the_paper_lead_from_the_base_to_the_whole_method():
    """Each step begins where the one before ended; at a fixed count the paper begins with motion alone."""
    assert [(c.with_, c.without) for c in COMPARISONS[:3]] == [("S", "base"), ("A+S", "S"), ("A+S+L", "A+S")]
    assert [c.published[BOTH]["psnr_full"] for c in COMPARISONS[:3]] == [0.04, 0.29, 0.12]
    fixed = [(c.with_, c.without) for c in COMPARISONS if "pulling" in c.published]
    assert fixed == [(f"A+S+L{FIXED}", f"S{FIXED}")]
    assert all(c.says for c in COMPARISONS if c.published)


def test_a_published_value_is_shown_for_the_clips_of_the_paper_alone():
    step, fixed = COMPARISONS[0], COMPARISONS[3]
    assert published_value(step, "psnr_full", ["endonerf_pulling"]) == 0.04
    assert published_value(step, "psnr_full", ["endonerf_pulling", "cutting_tissues_twice"]) == 0.04
    assert published_value(fixed, "psnr_full", ["endonerf_pulling"]) == 0.25
    assert published_value(fixed, "lpips", ["endonerf_cutting"]) == -0.0024
    assert published_value(fixed, "psnr_full", ["endonerf_pulling", "endonerf_cutting"]) is None
    assert published_value(step, "psnr_full", ["simulated"]) is None
    assert published_value(step, "psnr_full", ["endonerf_pulling", "simulated"]) is None
    assert published_value(COMPARISONS[5], "psnr_full", ["endonerf_pulling"]) is None


def test_comparisons_differ_in_what_they_claim_and_nothing_else(tmp_path):
    spec = spec_of(ablation_spec(["simulated"], 3, fixed_at=3000), "test", tmp_path)
    configs = {c.name: c for c in spec.configurations}
    for c in COMPARISONS:
        one, other = configs[c.with_], configs[c.without]
        assert one.start == other.start
        assert one.config.density == other.config.density and one.config.training == other.config.training
        prior = "prior" in c.claim
        assert (one.config.loss != other.config.loss) == prior and (one.config.model != other.config.model) != prior
    fixed = configs[f"A{FIXED}"]
    assert fixed.start == StartAt(configuration="base", iteration=3000) and fixed.config.density.until == 0
    assert model_of("S without prior")["loss"] == {"lambda_msp": 0.0}


def test_the_files_hold_what_was_measured(tmp_path):
    rows = [
        row(name, s, 30.0 + s + 0.25 * (name != "base"), "endonerf_pulling")
        for name in ("base", "S") for s in range(3)
    ]  # fmt: skip
    record = write_ablation(tmp_path, [*rows, open_row("A", 0)], ["endotsr", "ablate"])
    assert json.loads((tmp_path / FILES[0]).read_text()) == json.loads(json.dumps(record))
    assert record["runs"] == {"planned": 7, "finished": 6, "failed": []}
    text = (tmp_path / FILES[1]).read_text()
    assert "| S | PSNR full, dB | +0.25 | +0.25 to +0.25 | +0.25 to +0.25 | +0.25 |" in text
    assert "+0.04 | 3 on 1 |" in text
    assert (tmp_path / FILES[2]).read_bytes()[:4] == b"\x89PNG"


def test_without_a_pair_there_is_no_picture(tmp_path):
    record = write_ablation(tmp_path, [open_row("base", 0)], [])
    assert record["increments"] == [] and not (tmp_path / FILES[2]).exists()
    assert ablation_record([], [])["runs"]["planned"] == 0
    blank = {"psnr_full": None, "psnr_tissue": None, "lpips": 0.0}  # held-out frames without tissue
    record = write_ablation(tmp_path, [row(name, 0, 0.0) | blank for name in ("base", "S")], [])
    assert [found["metric"] for found in record["increments"]] == ["lpips"] and not (tmp_path / FILES[2]).exists()


def test_the_picture_has_a_mark_for_every_mean_pair_and_published_value(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, path: drawn.append(figure))
    rows = [
        row(name, s, 30.0 + s + 0.25 * (name != "base"), "endonerf_pulling")
        for name in ("base", "S", "A+S") for s in range(3)
    ]  # fmt: skip
    write_ablation(tmp_path, rows, [])
    (axes,) = drawn[0].axes
    marks = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    assert [name.get_text() for name in axes.get_yticklabels()] == [
        "S", "A added to S", "A and S together (ours)"
    ]  # fmt: skip
    np.testing.assert_allclose(marks["mean"], [(0.25, 0), (0.0, 1), (0.25, 2)], atol=1e-12)
    assert len(marks["one pair"]) == 9 and marks["as published"].tolist() == [[0.04, 0.0], [0.29, 1.0]]
    (legend,) = drawn[0].legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "95 %, Student", "95 %, bootstrap", "one pair", "mean", "as published"
    ]  # fmt: skip
