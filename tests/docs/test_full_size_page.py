"""docs/full_size.md: its generated parts are what the stored runs say, and so are its words and those of chapter 14."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pages.book import running_clip
from pages.full_size import page as full_size
from pages.full_size import pictures as full_size_pictures
from pages.full_size import text as full_size_text
from pages.full_size.text import psnr
from pages.store.intervals import interval, paired

from endotsr.errors import InputError

RUNS, LATER = full_size.PROGRAM.read(), running_clip.PROGRAM.read()
(PAGE,) = full_size.PROGRAM.pages
NOTEBOOK = Path(__file__).parents[2] / "notebooks" / "14_full_sequence.py"
LARGEST = 2_000_000  # bytes of all stored files


def test_stored_files_are_small_and_every_one_is_shown():
    files = [file for file in full_size.FOLDER.iterdir() if file.is_file()]
    assert sum(file.stat().st_size for file in files) <= LARGEST
    text = PAGE.read_text(encoding="utf-8")
    assert {file.name for file in files} - {full_size.PROGRAM.file.name} == set(
        re.findall(r"full_size/([\w.]+)\)", text)
    )


def test_a_preset_has_one_colour_in_all_panels():
    colours: dict[str, set[str]] = {}
    for axes in full_size_pictures.curves_figure(RUNS).axes:
        for line in axes.get_lines():
            colours.setdefault(line.get_label(), set()).add(line.get_color())
    assert {run["preset"] for run in RUNS.values()} <= set(colours)
    models = [colours[preset] for preset in full_size_text.PRESETS if preset in colours]
    assert all(len(of) == 1 for of in models) and len(set.union(*models)) == len(models)


def test_chosen_frames_are_the_worst_the_median_and_the_best():
    frames = [{"frame": i, "squared_error": {"model": value}} for i, value in enumerate((3.0, 1.0, 5.0, 2.0, 4.0))]
    assert full_size.chosen(frames) == {"worst": 2, "median": 0, "best": 1}
    for run in RUNS.values():
        assert full_size.chosen(run["frames"]) == run["shown"]


def test_a_clip_without_truth_is_refused(tmp_path):
    with pytest.raises(InputError, match="not a simulated clip"):
        full_size.noise_of(tmp_path, 1.0)


def test_the_regions_hold_the_whole_error():
    """Every kind of pixel once: the sums are those of the frames."""
    for run in RUNS.values():
        pixels = sum(row["pixels"] for row in run["regions"].values())
        whole = sum(row["model"] for row in run["regions"].values()) / pixels
        means = [row["squared_error"]["model"] for row in run["frames"]]
        assert min(means) < whole < max(means)
        assert pixels < len(run["frames"]) * run["width"] * run["height"]


def test_what_the_page_says_of_noise_and_motion():
    of_every_eighth = [run for run in RUNS.values() if run["split"] == "eighth"]
    flow = json.loads((full_size_text.RESULTS / "against_flow.json").read_text(encoding="utf-8"))["frames"]
    frame_1 = next(row["flow"] for row in flow if row["frame"] == 1)
    assert f"{frame_1:.2f} dB" in PAGE.read_text(encoding="utf-8")
    for run in of_every_eighth:
        assert psnr(run["noise"] ** 2) < 40 < frame_1
        slow = [row for row in run["frames"] if row["motion_px"] < 1]
        fast = [row for row in run["frames"] if row["motion_px"] > 2.9]
        assert slow and all(behind_flow(row) < 1 for row in slow)
        assert fast and all(behind_flow(row) > 3 for row in fast)
        means = {
            name: [np.mean([psnr(row["squared_error"][name]) for row in rows]) for rows in (slow, fast)]
            for name in ("flow_interpolation", "model")
        }
        lost = {name: of_slow - of_fast for name, (of_slow, of_fast) in means.items()}
        assert abs(lost["flow_interpolation"]) < 0.5
        assert 2.5 < lost["model"] < 3.5 if run["preset"] == "paper" else abs(lost["model"]) < 0.5


def test_what_the_page_says_of_the_noise_of_the_blend():
    """Without the noise that it adds itself the blend is ahead of `paper` and behind `quick`, within the intervals."""
    for preset, order in (("quick", ("model", "blend", "with noise")), ("paper", ("blend", "model", "with noise"))):
        run = RUNS[f"{preset}_eighth"]
        mean = {
            key: np.mean([row["squared_error"][key] for row in run["frames"]]) for key in full_size_text.PREDICTIONS
        }
        added = run["noise"] ** 2 * np.mean([row["blend_noise"] for row in run["frames"]])
        left = {"model": mean["model"], "blend": mean["two_neighbours"] - added, "with noise": mean["two_neighbours"]}
        assert tuple(sorted(left, key=lambda name: left[name])) == order
        ahead = [
            row["squared_error"]["model"]
            - row["squared_error"]["two_neighbours"]
            + run["noise"] ** 2 * row["blend_noise"]
            for row in run["frames"]
        ]
        mean_ahead, half = interval(ahead)
        assert abs(mean_ahead) < half


def behind_flow(row: dict) -> float:
    """How far the blend is below flow, dB."""
    return psnr(row["squared_error"]["flow_interpolation"]) - psnr(row["squared_error"]["two_neighbours"])


def test_what_chapter_14_says_of_the_blend():
    """1.5 dB below it for paper on the recorded clip; the seeds of quick have tests of their own."""
    words = " ".join(line.removeprefix("# ") for line in NOTEBOOK.read_text(encoding="utf-8").splitlines())
    means = full_size_text.means(full_size_text.recorded()["every_eighth", "paper"])
    assert f"`paper` is {means['blend'] - means['model']:.1f} dB<!--=paper.below_blend--> below the blend on a" in words


def test_the_first_sentences_of_the_page_are_true():
    recorded = full_size_text.recorded()
    for run in RUNS.values():
        ahead = full_size_text.ahead(run)
        assert round(ahead) == 2 if run["preset"] == "quick" else round(ahead, 1) == 0.6
    paper, sharp = (full_size_text.means(recorded["every_eighth", name]) for name in ("paper", "sharp"))
    assert paper["model"] < paper["blend"] and sharp["model"] > sharp["blend"]
    of = {name: full_size_text.by_frame(RUNS["quick_eighth"], name) for name in ("model", "flow_interpolation")}
    mean, half = interval(of["model"] - of["flow_interpolation"])
    assert mean < -half, "flow is ahead of the run of this page"
    later = [np.subtract(run["psnr"]["model"], run["psnr"]["flow_interpolation"]) for run in LATER["runs"]]
    mean, half = interval(np.mean(later, axis=0))
    assert len(later) == 3 and abs(mean) < half, "and level with the three later ones"


def test_differences_of_blocks_have_no_interval():
    assert paired([1.0, 3.0, 5.0, 5.0], [4, 5, 9, 10], 1) == "+2.0, +5.0"
    assert paired([1.0, 3.0], [1, 9], 1) == "+2.0 ± 12.7"
    lines = full_size_text.answer(RUNS).splitlines()
    assert all(("±" in line) == ("every eighth" in line) for line in lines if line.startswith("- "))
