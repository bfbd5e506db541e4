"""The page of claims: what it says is what the results say, and a verdict needs numbers."""

import functools
import json
import re
from itertools import pairwise

import numpy as np
import pytest
from pages.claims import page as claims
from pages.claims.answer import against, answer, baselines, black
from pages.claims.estimates import averaged, contrast, spread
from pages.claims.parts import planned_hours, protocols, tables
from pages.claims.power import least_size, pairs_needed, power
from pages.claims.protocols import MOVED, gain_of_the_right_eye, ours, right_eye, visits
from pages.claims.rules import increment_verdict, largest_verdict, level_verdict, no_change_verdict
from pages.claims.verdicts import HEADS, NOT_YET, STEPS, WHOLE, lead, verdicts, verdicts_of_both
from pages.store.intervals import student
from pages.store.published import MEANS_ON_TISSUE
from scipy import stats

from endotsr.cli.ablate import AblateOptions
from endotsr.cli.parts.fields import fields_of
from endotsr.studies.sweeps.ablation import BOTH, COMPARISONS
from endotsr.studies.sweeps.ablation_page import UNRECORDED, ablation_record

PAGE, GUIDE, *_ = claims.PROGRAM.pages
MEASURED = [name for name, file in claims.FILES.items() if (claims.RESULTS / file).exists()]


@functools.cache
def parts() -> dict[str, str]:
    """The generated parts of the page, made once."""
    return claims.parts()


def stored(name: str) -> dict:
    return json.loads((claims.RESULTS / claims.FILES[name]).read_text(encoding="utf-8"))


def cells(table: str, words: str) -> dict[str, str]:
    """The row of a table that begins with the words, by the heads of the verdicts."""
    return dict(zip(HEADS, row_of(table, words).strip("| ").split(" | "), strict=True))


def test_every_ablation_is_drawn_on_the_page(tmp_path):
    for name in MEASURED:
        record = claims.RESULTS / claims.FILES[name]
        assert f"](results/{record.stem}.svg)" in PAGE.read_text(encoding="utf-8")
        assert record.with_suffix(".svg").exists()
    (tmp_path / claims.FILES["pulling"]).write_text(json.dumps(made_up_record(0.28)), encoding="utf-8")
    claims.draw_ablations(tmp_path)
    assert [path.name for path in tmp_path.glob("*.svg")] == ["ablation_pulling.svg"]


def test_without_results_every_table_says_so():
    none = {"pulling": None, "cutting": None}
    assert verdicts(None, "pulling") == tables(None) == protocols([None], []) == claims.without_73(None) == NOT_YET
    assert verdicts_of_both(none).startswith("Not measured yet: pulling, cutting")
    rows = ours(none, [], None).splitlines()[2:]
    assert len(rows) == 16 and all("| not measured |" in row for row in rows) and gain_of_the_right_eye(None) == ""


@pytest.mark.parametrize("seeds", [0, 1, 2, 3])
@pytest.mark.parametrize("configurations", [("base",), ("base", "S", "A+S"), ("base", "S", "A+S", "A+S+L")])
def test_every_table_is_made_from_any_part_of_an_ablation(seeds, configurations, tmp_path):
    """The second clip arrives run by run."""
    record = made_up_clip("endonerf_cutting", seeds, configurations)
    (tmp_path / claims.FILES["cutting"]).write_text(json.dumps(record), encoding="utf-8")
    for name in ("pulling", "simulated"):
        (tmp_path / claims.FILES[name]).write_text(json.dumps(stored(name)), encoding="utf-8")
    (tmp_path / "effects_truth.json").write_bytes((claims.RESULTS / "effects_truth.json").read_bytes())
    made = claims.parts(tmp_path)
    row = cells(made["verdicts_cutting"], "Temporal appearance improves on spectral motion alone: PSNR")
    if seeds and "A+S" in configurations:
        assert row["verdict"] == ("reproduced" if seeds > 2 else f"not decided: {seeds} of 3 seeds")
        assert row["published"] == "+0.29 dB, mean of both clips" and row["better in"] == f"{seeds} of {seeds}"
    else:
        assert row["mean (median)"] == NOT_YET
    assert claims.NO_FRAMES in made["cutting_without"] or seeds == 0
    if seeds == 1:
        lines = made["verdicts_cutting"].splitlines()[2:]
        rows = [dict(zip(HEADS, line.strip("| ").split(" | "), strict=True)) for line in lines if NOT_YET not in line]
        assert rows and all(row["verdict"].startswith("not decided") for row in rows)


def made_up_clip(sequence: str, seeds: int, configurations: tuple[str, ...], step: float = 0.3) -> dict:
    """An ablation with equal steps and a little noise that is not the same in any two runs."""
    rows = []
    for seed in range(seeds):
        for k, name in enumerate(configurations):
            psnr = 40.0 + step * k + seed + 0.003 * ((7 * seed + 3 * k) % 5)
            rows.append(finished(name, seed, sequence, psnr))
    return json.loads(json.dumps(ablation_record(rows, ["endotsr", "ablate"])))


def finished(name: str, seed: int, sequence: str, psnr: float, **more) -> dict:
    """A finished run."""
    return {
        "name": f"{name}{seed}", "sequence": sequence, "split": "every_eighth", "configuration": name, "seed": seed,
        "status": "finished", "psnr_full": psnr, "psnr_tissue": psnr - 1.8, "ssim_full": 0.96 + psnr / 1e4,
        "ssim_tissue": 0.95 + psnr / 1e4, "lpips": 0.05 - psnr / 1e3, "lpips_symmetric": 0.08 - psnr / 1e3,
        "iterations": 6000, "preset": "paper", "gaussians": 60000, "arrays_sha256": {"images": "a"}, "seconds": 600.0,
        "threads": 1, "width": 640, "height": 512, "baselines": {},
    } | more  # fmt: skip


def test_the_frame_without_training_data_is_left_out_of_every_mean():
    """Frame 73 is 10 dB lower; one configuration is better on it alone."""
    rows = []
    for seed in range(3):
        for name, gain in (("S", 0.0), ("A+S", 0.3 + 0.01 * seed)):
            frames = [{"frame": 1, "psnr_full": 40.0 + gain}, {"frame": 73, "psnr_full": 30.0 + 10 * gain}]
            mean = sum(frame["psnr_full"] for frame in frames) / 2
            rows.append(finished(name, seed, "endonerf_cutting", mean, per_frame=frames))
    record = json.loads(json.dumps(ablation_record(rows, [])))
    whole, part = (verdicts(found, "cutting") for found in (record, claims.without_frames(record, {73})))
    words = "Temporal appearance improves on spectral motion alone: PSNR"
    assert cells(whole, words)["mean (median)"].startswith("+1.705 dB")
    assert cells(part, words)["mean (median)"].startswith("+0.310 dB") and claims.without_73(record) == part


@pytest.mark.parametrize(
    "published, interval, pairs, verdict",
    [
        (0.29, (0.2, 0.4), 3, "reproduced"),
        (0.29, (0.2, 0.4), 2, "not decided: 2 of 3 seeds"),
        (0.29, None, 3, "not decided: 3 of 3 seeds"),
        (0.29, (-0.1, 0.4), 3, "not decided: the interval contains 0 too"),
        (0.29, (-0.1, 0.2), 3, "not reproduced"),
        (0.29, (0.4, 0.5), 3, "direction reproduced, size not"),
        (0.29, (-0.4, -0.2), 3, "not reproduced: the opposite"),
        (-0.002, (-0.003, -0.001), 3, "reproduced"),
        (-0.002, (-0.001, -0.0005), 3, "direction reproduced, size not"),
    ],
)
def test_verdicts_of_differences(published, interval, pairs, verdict):
    assert increment_verdict(published, interval, pairs) == verdict


@pytest.mark.parametrize(
    "interval, verdict",
    [((-0.005, 0.009), "reproduced"), ((-0.05, 0.02), "not decided: the interval is wider"),
     ((0.02, 0.05), "not reproduced"), (None, "not decided: 3 of 3 seeds")],
)  # fmt: skip
def test_verdicts_of_no_change(interval, verdict):
    assert no_change_verdict(interval, 3) == verdict


def test_verdicts_of_levels():
    assert level_verdict(39.34, (39.0, 39.5), True, 0.01) == "reproduced"
    assert level_verdict(39.34, (40.0, 41.0), True, 0.01) == "better than published"
    assert level_verdict(39.34, (38.0, 39.0), True, 0.01) == "not reproduced: worse"
    assert level_verdict(0.035, (0.03, 0.04), False, 0.001) == "reproduced"
    assert level_verdict(0.035, (0.04, 0.05), False, 0.001) == "not reproduced: worse"
    assert level_verdict(0.035, (0.02, 0.03), False, 0.001) == "better than published"
    assert level_verdict(39.34, None, True, 0.01) == "not decided: one seed"


@pytest.mark.parametrize("high, verdict", [(0.9664, "not reproduced: worse"), (0.9666, "reproduced")])
def test_a_published_level_is_known_to_its_last_digit(high, verdict):
    assert level_verdict(0.967, (0.96, high), True, 0.001) == verdict
    mean, (low, high) = student([39.0, 39.2, 39.4])
    assert mean == pytest.approx(39.2) and high - low == pytest.approx(2 * 4.30265 * 0.2 / 3**0.5, rel=1e-5)


def test_the_largest_step_is_ahead_of_each_other():
    both, open_, behind = [(0.1, 0.3), (0.2, 0.4)], [(0.1, 0.3), (-0.1, 0.4)], [(0.1, 0.3), (-0.4, -0.1)]
    assert largest_verdict(both, 3, True) == "reproduced" and largest_verdict(both, 3, False) == "not reproduced"
    assert largest_verdict(open_, 3, True) == "not decided: an interval contains 0"
    assert largest_verdict(behind, 3, True) == "not reproduced"
    assert largest_verdict(both, 2, True) == largest_verdict([None, None], 2, True) == "not decided: 2 of 3 seeds"


def made_up_record(gain: float) -> dict:
    """An ablation of two configurations and three seeds."""
    steps = (("S", 0.0, 0.0), ("A+S", gain, 0.01))
    rows = [finished(name, k, "pulling", 38.0 + k + more + k * noise) for k in range(3) for name, more, noise in steps]
    return json.loads(json.dumps(ablation_record(rows, ["endotsr", "ablate"])))


def test_a_measured_claim_has_verdict_number_and_interval():
    words = "Temporal appearance improves on spectral motion alone: PSNR"
    row = cells(verdicts(made_up_record(0.28), "pulling"), words)
    assert (row["compared"], row["published"]) == ("A+S - S", "+0.29 dB, mean of both clips")
    assert row["mean (median)"] == "+0.290 dB (+0.290)" and row["verdict"] == row["verdict with it"] == "reproduced"
    assert row["paired interval"] == "+0.265 to +0.315 dB" and row["better in"] == "3 of 3"
    assert cells(verdicts(made_up_record(-0.5), "pulling"), words)["verdict"] == "not reproduced: the opposite"
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
    table = ours({"pulling": None, "cutting": None}, [half_record(gains)], half_record(gains))
    low, high = stats.ttest_1samp(gains, 0.0).confidence_interval(0.95)
    shown = f"{low:+.2f} to {high:+.2f} dB" if len(gains) > 2 else "-"
    for words in ("Every second frame", "The view of the right eye, at held-out"):
        line = row_of(table, words)
        assert "| A+S+L - base, 320x256, 3500 iterations |" in line
        assert f"| {verdict} | {np.mean(gains):+.2f} dB | {shown} |" in line
    assert "+0.00 dB" in row_of(table, "The view of the right eye, at training")
    assert "not measured" in row_of(table, "Blocks of 2")
    assert "`base` 30.00 dB, `A+S+L` 30.00 dB, left picture moved" in right_eye(half_record(gains))
    assert right_eye(half_record(gains)).endswith("33.00 dB.") and "not measured" in right_eye(None)


def test_what_the_page_says_of_the_right_camera():
    """A gain in every seed for the trained view, none for the other, and the moved left picture ahead of both."""
    half = stored("pulling_pairs")
    gains = next(r for r in half["increments"] if r["metric"] == "psnr_full")["of"]
    assert all(pair["difference"] > 0 for pair in gains)
    row = row_of(parts()["ours"], "The view of the right eye, at held-out")
    assert "not decided" in row and row.endswith("| 0.29 dB |")
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
    [("Spectral motion improves on the base: PSNR", "S", "base"),
     ("Temporal appearance improves on spectral motion alone: PSNR", "A+S", "S"),
     ("Laplacian detail improves on both residuals: PSNR", "A+S+L", "A+S"),
     ("With a fixed number of Gaussians, appearance and detail improve on motion alone: PSNR",
      "A+S+L fixed", "S fixed"),
     ("At a fixed representation", "S fixed", "S without prior fixed")],
)  # fmt: skip
def test_a_claim_is_about_the_pair_of_the_paper(words, with_, without):
    """The page against SciPy on the stored runs: the pairs stand here once more, apart from the code."""
    record = stored("pulling")
    difference = psnr(record, with_) - psnr(record, without)
    low, high = stats.ttest_1samp(difference, 0.0).confidence_interval(0.95)
    row = cells(parts()["verdicts_pulling"], words)
    assert row["compared"] == f"{with_} - {without}" and row["better in"] == f"{(difference > 0).sum()} of 3"
    assert row["mean (median)"] == f"{difference.mean():+.3f} dB ({np.median(difference):+.3f})"
    assert row["paired interval"] == f"{low:+.3f} to {high:+.3f} dB"


def test_the_common_spread_is_that_of_a_least_squares_fit():
    """Against a linear model with a column for every configuration and seed, fitted by NumPy."""
    record = stored("pulling")
    rows = [r for r in record["rows"] if "fixed" not in r["configuration"]]
    names = sorted({row["configuration"] for row in rows})
    design = np.zeros((len(rows), len(names) + 3))
    for k, row in enumerate(rows):
        design[k, names.index(row["configuration"])] = design[k, len(names) + row["seed"]] = 1.0
    values = np.array([row["psnr_full"] for row in rows])
    fit, _, rank, _ = np.linalg.lstsq(design, values, rcond=None)
    found = spread(record, "psnr_full", fixed=False)
    assert found is not None and found.freedom == len(rows) - rank == 12
    deviation = np.sqrt(np.square(values - design @ fit).sum() / (len(rows) - rank))
    assert found.deviation == pytest.approx(deviation, rel=1e-9)
    low, high = contrast(record, WHOLE, "psnr_full").common
    assert high - low == pytest.approx(2 * stats.t.ppf(0.975, 12) * deviation * np.sqrt(2 / 3), rel=1e-9)
    low, high = contrast(record, lead("A", "L"), "psnr_full").common  # 2 (A+S) - S - (A+S+L)
    assert high - low == pytest.approx(2 * stats.t.ppf(0.975, 12) * deviation * np.sqrt(6 / 3), rel=1e-9)


def test_the_common_interval_covers_the_truth_as_often_as_it_says():
    """2000 ablations of two steps of 0.1 with noise, seeds 10 dB apart."""
    rng, covered = np.random.default_rng(4), 0
    for _ in range(2000):
        values = np.array([[0.0], [0.1], [0.2]]) + 10.0 * rng.normal(size=(1, 3)) + rng.normal(0.0, 0.3, (3, 3))
        rows = [
            {"configuration": name, "split": "every_eighth", "seed": s, "psnr_full": values[k, s]}
            for k, name in enumerate(("base", "S", "A+S")) for s in range(3)
        ]  # fmt: skip
        low, high = contrast({"rows": rows}, {"A+S": 1, "S": -1}, "psnr_full").common
        covered += low <= 0.1 <= high
    assert covered / 2000 == pytest.approx(0.95, abs=0.02)


def test_the_mean_of_both_clips_weights_them_equally():
    a, b = (made_up_clip(f"endonerf_{clip}", 3, ("base", "S", "A+S", "A+S+L"), step)
            for clip, step in (("pulling", 0.2), ("cutting", 0.4)))  # fmt: skip
    of_clips = [contrast(found, STEPS["A"], "psnr_full") for found in (a, b)]
    both = averaged(of_clips)
    assert both.mean == pytest.approx((of_clips[0].mean + of_clips[1].mean) / 2) and len(both.values) == 6
    low, high = stats.ttest_ind(
        of_clips[0].values, [-v for v in of_clips[1].values], equal_var=False
    ).confidence_interval()
    assert both.paired == pytest.approx((low / 2, high / 2))
    table = verdicts_of_both({"pulling": a, "cutting": b})
    assert cells(table, "Temporal appearance improves on spectral motion alone: PSNR")["verdict"] == "reproduced"


def test_published_steps_are_the_differences_of_the_published_means():
    """Of rounded levels, so to one unit of the last digit."""
    steps = {c.with_: c.published[BOTH] for c in COMPARISONS if BOTH in c.published}
    for (before, low), (after, high) in pairwise(MEANS_ON_TISSUE.items()):
        assert before != after
        gained = dict(zip(("psnr_full", "ssim_tissue", "lpips"), np.subtract(high, low), strict=True))
        for metric, unit in (("psnr_full", 0.01), ("ssim_tissue", 0.0001), ("lpips", 0.0001)):
            assert steps[after][metric] == pytest.approx(gained[metric], abs=1.01 * unit)


def test_the_answer_says_what_the_records_say():
    """Its numbers, computed here once more; a clip that is not measured is named."""
    record = stored("pulling")
    text = parts()["answer"]
    whole, step = psnr(record, "A+S+L") - psnr(record, "base"), psnr(record, "A+S") - psnr(record, "S")
    low, high = stats.ttest_1samp(whole, 0.0).confidence_interval(0.95)
    assert low < 0 < high
    found = f"| pulling | {whole.mean():+.2f} | {low:+.2f} to {high:+.2f} | not decided: the interval contains 0 too |"
    assert found in text and f"| A, over S | +0.29 | pulling | {step.mean():+.2f} | " in text
    of_cutting = psnr(stored("cutting"), "A+S") - psnr(stored("cutting"), "S")
    both = (step.mean() + of_cutting.mean()) / 2
    assert f"| +0.29 | cutting | {of_cutting.mean():+.2f} | " in text
    assert f"| +0.29 | mean of both | {both:+.2f} | " in text
    level, base = psnr(record, "A+S+L"), psnr(record, "base")
    assert f"| pulling | 39.34 | {level.mean():.2f} ± " in text and f"| {base.mean():.2f} ± " in text
    truth = json.loads((claims.RESULTS / "effects_truth.json").read_text(encoding="utf-8"))["scenes"]["motion"]
    motion = np.array([run["psnr"] for run in truth["`paper`"]]) - [run["psnr"] for run in truth["`paper` without A"]]
    low, high = stats.ttest_1samp(motion, 0.0).confidence_interval(0.95)
    assert f"{motion.mean():+.2f} ± {(high - low) / 2:.2f} dB where only the tissue moves" in text
    bare = answer(claims.RESULTS, {"pulling": record, "cutting": None}, [], "")
    assert "on cutting is not finished" in bare and "right camera" not in bare and "1 combinations" in bare
    assert "mean of both |" not in bare and "iterations" not in next(
        row for row in bare.splitlines() if "combin" in row
    )
    assert "| cutting | 40.96 | - | - | 42.80 |" in bare


def test_the_answer_says_what_excluded_pixels_add():
    """Of the pixels of a frame a fraction is black in both pictures: the masks of the clip, not the prediction."""
    rows = json.loads((claims.RESULTS / "interpolation.json").read_text(encoding="utf-8"))["clips"]
    of = rows["endonerf_pulling"]["every eighth frame"]["baselines"]
    added = [np.subtract(of[name]["psnr_full"], of[name]["psnr_tissue"]) for name in of]
    assert all(row == pytest.approx(added[0], abs=1e-5) for row in added)
    said = black(claims.RESULTS)
    assert f"which adds {added[0].mean():.2f} dB, and" in said and said in parts()["answer"]
    assert f"{100 * np.mean(1 - 10 ** (-added[0] / 10)):.1f} % of the pixels of pulling" in said


def test_the_answer_states_no_order_within_the_interval_of_the_level():
    assert [against(39.05, value, 0.2) for value in (39.0, 38.8, 39.3)] == ["level with", "above", "below"]
    assert against(39.05, 39.0, 0.0) == "above"
    mean, limits = student([*psnr(stored("pulling"), "A+S+L")])
    blend = baselines(claims.RESULTS, "pulling")["two_neighbours_tissue"]
    text = parts()["answer"]
    assert f"{against(mean, blend, limits[1] - mean)} the tissue-only blend" in text and f"| {blend:.2f} |" in text


def test_what_the_page_says_of_the_largest_step():
    """SSIM: above both others with either interval. PSNR: above L; open against S, whose step varies most."""
    record = stored("pulling")
    for other in ("S", "L"):
        of = contrast(record, lead("A", other), "ssim_tissue")
        assert of.paired[0] > 0 and of.common[0] > 0
    assert contrast(record, lead("A", "L"), "psnr_full").paired[0] > 0
    low, high = contrast(record, lead("A", "S"), "psnr_full").paired
    assert low < 0 < high
    deviations = {name: np.std(contrast(record, terms, "psnr_full").values) for name, terms in STEPS.items()}
    assert max(deviations, key=deviations.get) == "S"


def test_runs_without_hashes_are_labelled_in_their_tables():
    made = parts()
    for name in MEASURED:
        recorded = all(row.get("arrays_sha256") for row in stored(name)["rows"])
        assert (UNRECORDED in made[name]) == (not recorded)
    assert UNRECORDED in made["pulling"]


@pytest.mark.parametrize("pairs", [2, 3, 5, 12])
def test_the_power_of_the_test_is_what_a_simulation_finds(pairs):
    """20 000 trials of normal differences at the size that is said to be seen in four of five."""
    size = least_size(pairs)
    drawn = np.random.default_rng(pairs).normal(size, 1.0, (20_000, pairs))
    low, high = stats.ttest_1samp(drawn, 0.0, axis=1).confidence_interval(0.95)
    assert np.mean((low > 0) | (high < 0)) == pytest.approx(0.8, abs=0.01)
    assert pairs_needed(size * 1.001) == pairs


@pytest.mark.parametrize("size", [2.5, 0.9, 0.4, 0.2])
def test_one_seed_less_than_needed_is_too_few(size):
    needed = pairs_needed(size)
    assert power(size, needed) >= 0.8 > (power(size, needed - 1) if needed > 2 else 0.0)


@pytest.mark.parametrize("low, high, verdict", [(0.2, 0.4, "reproduced"), (0.7, 0.9, "direction reproduced, size not"),
                                                (-0.1, 0.4, "not decided: the interval contains 0 too"),
                                                (-0.1, 0.2, "not reproduced")])  # fmt: skip
def test_a_published_range_is_met_or_not(low, high, verdict):
    assert increment_verdict(0.31, (low, high), 3, 0.66) == verdict == increment_verdict(0.66, (low, high), 3, 0.31)


def test_steps_are_compared_by_paired_tests_of_the_steps():
    record = stored("pulling")
    base, s, a, whole = (psnr(record, name) for name in ("base", "S", "A+S", "A+S+L"))
    shown = []
    for ahead in ((a - s) - (s - base), (a - s) - (whole - a)):
        low, high = stats.ttest_1samp(ahead, 0.0).confidence_interval(0.95)
        shown.append(f"{low:+.3f} to {high:+.3f} dB")
    row = cells(parts()["verdicts_pulling"], "Temporal appearance is the largest of the three steps: PSNR")
    assert row["paired interval"] == "; ".join(shown) and row["verdict"] == "not decided: an interval contains 0"
    assert {c.with_: c.without for c in COMPARISONS[:3]} == {"S": "base", "A+S": "S", "A+S+L": "A+S"}


@pytest.mark.parametrize("name", MEASURED)
def test_the_stored_differences_are_those_of_the_stored_runs(name):
    record = stored(name)
    again = json.loads(json.dumps(claims.compared(record)))
    assert again["increments"] == record["increments"] and again["levels"] == record["levels"]


@pytest.mark.parametrize("name", MEASURED)
def test_differences_on_tissue_are_those_of_the_whole_image(name):
    record = stored(name)
    of = {(r["claim"], r["split"], r["metric"]): r["mean"] for r in record["increments"]}
    whole = {key[:2]: mean for key, mean in of.items() if key[2] == "psnr_full"}
    assert whole and all(abs(of[*key, "psnr_tissue"] - mean) < 1e-9 for key, mean in whole.items())


def test_lpips_has_a_verdict_for_each_range_of_its_input():
    table = parts()["verdicts_pulling"]
    rows = [cells(table, f"Level: LPIPS, input in {where}") for where in ("[0, 1]", "[-1, 1]")]
    level = next(level for level in stored("pulling")["levels"] if level["configuration"] == "A+S+L")
    shown = [f"{level['lpips']:.4f}", f"{level['lpips_symmetric']:.4f}"]
    assert [row["mean (median)"] for row in rows] == shown
    assert [row["verdict"] for row in rows] == ["better than published", "not reproduced: worse"]


def test_the_rules_stand_before_the_numbers():
    text = PAGE.read_text(encoding="utf-8")
    assert text.index("**Reproduced**") < text.index("<!-- claims:verdicts_pulling:start -->")


def test_what_the_paper_does_not_contain_stands_apart():
    """No row of ours among the verdicts, none of the paper among ours, and nothing is "not at hand"."""
    made = parts()
    for words in ("right eye", "Every second", "Blocks of", "end of the clip", "cross-fade", "free number"):
        assert words not in made["verdicts_pulling"] and words in made["ours"]
    assert "published" not in made["ours"] and "not at hand" not in PAGE.read_text(encoding="utf-8")
    rows = [line for line in made["pulling"].splitlines() if "| PSNR full, dB |" in line]
    marked = {line.split(" | ")[0].removeprefix("| ") for line in rows if "(ours)" in line}
    said = {c.claim for c in COMPARISONS if c.says}
    assert marked and "A alone (ours)" in marked and not {name.removesuffix(" (ours)") for name in marked} & said


def test_the_visits_are_those_of_the_splits():
    """Frames 1, 3, ... of 63 leave 32; blocks of two in periods of 24 leave 57; the last eight and every eighth 55."""
    text = parts()["visits"]
    for count, frames in ((55, 32), (31, 57), (32, 55)):
        assert f"{count} visits to each of {frames} frames" in text and count == round(1750 / frames)
    assert "makes 109 visits" in text and round(6000 / 55) == 109
    longer = {"rows": [{"split": "every_second", "iterations": 3200}]}
    assert visits([longer, None]).startswith("3200 iterations make 100 visits to each of 32 frames with every second")
    assert visits([None]) == "A full run makes 109 visits to each frame."


def test_hours_follow_the_model():
    assert planned_hours(15, 2, 30.0, begin=0.0) == pytest.approx(8 * 30 / 60)
    assert planned_hours(15, 4, 30.0, threads=2, begin=0.0) == pytest.approx(8 * 15 / 60)
    assert planned_hours(15, 64, 30.0, begin=1.0) == pytest.approx(31 / 60)
    assert planned_hours(0, 2, 30.0) == 0.0
    with pytest.raises(ValueError, match="no worker"):
        planned_hours(3, 1, 30.0, threads=2)


def test_the_commands_of_the_page_have_the_options_that_exist():
    text = PAGE.read_text(encoding="utf-8") + GUIDE.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("endotsr ablate ")]
    names = {field.name for field in fields_of(AblateOptions)}
    assert lines and all(word in names for line in lines for word in line.split() if word.startswith("--"))
