"""docs/results/README.md: its tables are what the committed results say."""

import json
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from pages.book import figures, presets, readme_gaps
from pages.full_size import interpolation, levers, record
from pages.store.intervals import interval

from endotsr.config import PAPER, PRESETS, lengthened
from endotsr.errors import InputError

RESULTS = Path(__file__).parents[2] / "docs" / "results"


def test_the_figures_of_the_prose_are_those_of_the_records():
    for page in figures.pages():
        text = page.read_text(encoding="utf-8")
        assert figures.substituted(text) == text, page.name
    named = {"flow.tissue", "sharp.tissue", "paper.tissue"}
    for page, names in (("../README.md", named), ("interpolation.md", named | {"blend.tissue"})):
        text = (RESULTS.parent / page).read_text(encoding="utf-8")
        assert names <= set(re.findall(r"<!--=([\w.]+)-->", text)), page


def test_a_planted_figure_is_replaced_and_one_without_a_number_or_a_record_is_refused():
    assert figures.substituted("with 50.00 dB<!--=flow.tissue--> here") == "with 39.83 dB<!--=flow.tissue--> here"
    with pytest.raises(InputError, match="no number"):
        figures.substituted("with many<!--=flow.tissue-->")
    with pytest.raises(InputError, match=r"no figure 'flow\.gone'"):
        figures.substituted("with 1 dB<!--=flow.gone-->")
    with pytest.raises(InputError, match="no such record"):
        figures.value(figures.Figure("gone*.json", "x", "{}"))


def test_the_readme_compares_with_flow_as_recorded():
    """For one frame: flow, `sharp`, blend, `paper`. At 16 `sharp` is below the blend of its own renders."""
    means = {name: figures.value(figures.FIGURES[f"{name}.tissue"]) for name in ("flow", "sharp", "blend", "paper")}
    assert sorted(means, key=means.get, reverse=True) == ["flow", "sharp", "blend", "paper"]
    assert figures.value(figures.FIGURES["sharp.blocks16"]) < figures.value(figures.FIGURES["sharp.fade16"])


def test_no_scene_is_more_accurate_than_the_best_interpolation():
    """As the head of README says: behind it, or level (within the interval, or ahead in some blocks only)."""
    for gap in readme_gaps.GAPS:
        for metric, sign in (("psnr_tissue", 1), ("lpips", -1)):
            names = [*readme_gaps.NAMES]
            best = max(names, key=lambda name: sign * readme_gaps.predicted(gap, name, metric).mean())
            lead = sign * readme_gaps.difference(gap, best, metric)
            level = lead.mean() <= interval([*lead])[1] if gap == 1 else lead.min() < 0
            assert lead.mean() < 0 or level, (gap, metric, best)
    of = {clip: figures.value(figures.FIGURES[clip]) for clip in ("flow.cutting", "sharp.cutting")}
    assert of["sharp.cutting"] < of["flow.cutting"]
    names = ("rife.cutting.lpips", "sharp.cutting.lpips")
    assert figures.value(figures.FIGURES[names[0]]) < figures.value(figures.FIGURES[names[1]])


def test_on_cutting_interpolation_is_ahead_in_psnr():
    names = ("flow.cutting", "blend.cutting", "flow_tissue.cutting", "sharp.cutting")
    means = [figures.value(figures.FIGURES[name]) for name in names]
    assert means == sorted(means, reverse=True)


def test_on_cutting_sharp_is_ahead_in_lpips():
    for file in sorted(RESULTS.glob("cutting_sharp_seed?.json")):
        found = json.loads(file.read_text(encoding="utf-8"))
        others = [row["mean"]["lpips"] for row in found["baselines"].values()]
        assert (
            found["held_out"]["mean"]["lpips"]
            < min(others)
            == found["baselines"]["flow_interpolation"]["mean"]["lpips"]
        )


@pytest.mark.parametrize("preset", ["quick", "sharp"])
@pytest.mark.parametrize("clip", ["pulling", "cutting"])
def test_three_recorded_seeds_have_the_settings_of_the_preset_today(clip, preset):
    """A setting that is younger than the record has its default in both."""
    seeds = [run for name, run in record.stored(clip).items() if f"_{preset}_seed" in name]
    defaults = msgspec.to_builtins(PAPER)
    assert [run["run"]["seed"] for run in seeds] == [0, 1, 2]
    for run in seeds:
        settings, trained = run["run"]["settings"], run["frames"]["training"]
        wanted = msgspec.to_builtins(lengthened(PRESETS[preset], trained))
        for section in ("model", "loss", "optimiser", "density", "initialisation"):
            assert defaults[section] | settings[section] == wanted[section], f"{section}: record the runs again"
        assert run["run"]["iteration"] == wanted["training"]["iterations"]


def test_the_readme_states_the_minutes_that_were_timed():
    rows = json.loads((RESULTS / "minutes.json").read_text(encoding="utf-8"))["rows"]
    made = presets.table()
    assert all(f"| `{name}` |" in made for name in ("paper", "sharp", "quick")) and "--minutes" not in made
    assert "| flow | - | 41.61 | 0.0125 | - |" in made and "| flow | - | - | - | 41.61 |" in presets.recorded()
    assert f"| {rows['quick'][0]['seconds'] / 60:.1f} |" in made and "another machine of this name took longer" in made
    waited = json.loads((RESULTS / "waiting.json").read_text(encoding="utf-8"))["rows"]
    (other,) = [
        row for row in waited if (row["clip"], row["preset"], row["clock"]) == ("endonerf_pulling", "sharp", "wall")
    ]
    assert other["processor"] == rows["sharp"][0]["processor"]
    assert other["trained"] - other["curve"][0]["seconds"] > rows["sharp"][0]["seconds"], "nine tenths of it"


def test_differences_are_paired_by_seed():
    """The same offset on both seeds has no width, however far apart the seeds are."""
    runs = {
        levers.SHARP: [{"psnr_tissue": 30.0}, {"psnr_tissue": 40.0}],
        levers.PAPER: [{"psnr_tissue": 29.0}, {"psnr_tissue": 39.0}],
    }
    found = {"scenes": {"clip": runs}, "seeds": 2, "iterations": 9, "date": "-", "machine": {"processor": "x"}}
    rows = [line for line in levers.table(found).splitlines() if line.startswith("| clip")]
    assert rows == ["| clip | `sharp` | 35.00 | - |", "| clip | `paper` | -1.00 ± 0.00 | - |"]


def test_the_readme_says_of_the_gaps_what_their_table_says():
    difference = readme_gaps.difference
    (mean, half), tissue_only = (interval([*difference(1, name)]) for name in readme_gaps.AGAINST)
    assert -half < mean < 0 and tissue_only[0] > tissue_only[1]
    for gap, blocks in ((4, 3), (8, 2)):
        flow, tissue = difference(gap, readme_gaps.FLOW), difference(gap, readme_gaps.TISSUE)
        assert flow.min() < 0 < flow.max() and tissue.min() > 0 and flow.size == blocks
    assert difference(16, readme_gaps.FLOW).min() > 0 > difference(16, readme_gaps.TISSUE).mean()
    rife = difference(8, readme_gaps.RIFE)
    assert rife.size == 2 and 0 < rife.max() < -rife.min()
    for gap in readme_gaps.GAPS:
        model = readme_gaps.by_frame(readme_gaps.runs_of(gap), metric="lpips").mean()
        copy, _, flow, tissue, network = (
            readme_gaps.predicted(gap, name, "lpips").mean() for name in readme_gaps.NAMES
        )
        assert network < flow < model and (tissue < model) == (gap != 1) and (copy < flow) == (gap != 4)


def against_flow_of_tissue(clip, metric):
    """Mean and half interval over the held-out frames of `sharp` less the flow of tissue, with one frame missing."""
    seeds = []
    for file in sorted(RESULTS.glob(f"{clip}_sharp_seed?.json")):
        run = json.loads(file.read_text(encoding="utf-8"))
        pairs = zip(
            run["held_out"]["per_frame"], run["baselines"]["flow_interpolation_tissue"]["per_frame"], strict=True
        )
        seeds.append([scene[metric] - flow[metric] for scene, flow in pairs])
    assert len(seeds) == 3
    return interval([*np.mean(seeds, axis=0)])


def test_of_one_missing_frame_the_page_says_what_the_records_say():
    def lead(clip, metric):
        found, half = against_flow_of_tissue(clip, metric)
        return "ahead" if found > half else "behind" if found < -half else "level"

    assert (lead("pulling", "psnr_tissue"), lead("cutting", "psnr_tissue")) == ("ahead", "level")
    assert (lead("pulling", "lpips"), lead("cutting", "lpips")) == ("level", "behind")  # less is better
    assert against_flow_of_tissue("pulling", "lpips")[0] < 0


def test_a_gap_of_several_frames_has_no_interval():
    """The frames of a block are not independent, and the table says how many blocks there are."""
    assert "±" in readme_gaps.row(1)[-1] and all("±" not in "".join(readme_gaps.row(gap)) for gap in (4, 8, 16))
    assert [readme_gaps.row(gap)[1] for gap in (1, 16)] == ["8 frames", "2 blocks"]


def made_up(preset, seed, values):
    """The record of a run on cutting: PSNR of frames 65 and 73."""
    frames = [{"frame": frame, "psnr_full": value} for frame, value in zip((65, 73), values, strict=True)]
    part = {"label": "Copy", "mean": {"psnr_full": sum(values) / 2}, "per_frame": frames}
    settings = {"preset": preset, "sequence": {"split": "every_eighth", "block_length": 8}}
    run = {"settings": settings, "input": {"source": "endonerf_cutting"}, "seed": seed}
    return {
        "run": run, "held_out": part, "baselines": {"nearest_frame": part}, "frames": {"held_out": [65, 73]},
        "published": [{"label": "as published", "psnr_full": 40.96}],
    }  # fmt: skip


def test_a_table_of_cutting_has_the_means_without_its_two_frames():
    records = {f"cutting_quick_seed{seed}": made_up("quick", seed, (40.0, 30.0)) for seed in (0, 1)}
    head, _, model, copy, published = record.table(records).splitlines()
    assert head.startswith("| endonerf_cutting, held out: every eighth frame (in brackets without frame 73) |")
    assert model.startswith("| endotsr, preset `quick`, mean of 2 seeds | 35.00 ± 0.00 (40.00 ± 0.00) | - |")
    assert copy.startswith("| Copy | 35.00 (40.00) | - |") and published.startswith("| as published | 40.96 | - |")


def test_older_records_show_the_baselines_that_obey_the_masks_of_the_same_held_out_frames():
    runs = record.stored("pulling")
    shown = interpolation.PROGRAM.read()["clips"]["endonerf_pulling"]["every eighth frame"]["baselines"]
    mean = sum(shown["flow_interpolation_tissue"]["psnr_tissue"]) / 8
    assert f"| Optical-flow interpolation (DIS), tissue only | 39.99 | {mean:.2f} |" in record.table(runs)
    assert interpolation.tissue_only("endonerf_pulling", "every eighth frame", frames=[0, 8]) == {}


def test_the_seeds_that_are_not_measured_are_named():
    records = {"cutting_quick_seed0": made_up("quick", 0, (40.0, 30.0))}
    said = "This table lacks runs on cutting: `paper` 0 of 5 seeds, `quick` 1 of 3 seeds, `sharp` 0 of 3 seeds. "
    assert record.missing("cutting", records).startswith(said)
    assert record.table(records).splitlines()[2].startswith("| endotsr, preset `quick`, one seed | 35.00 (40.00) |")
    assert record.missing("pulling", record.stored("pulling")) == ""


def test_the_splits_without_interpolation_are_named():
    found = json.loads((RESULTS / "interpolation.json").read_text(encoding="utf-8"))
    del found["clips"]["endonerf_pulling"]["blocks of 8 frames"]
    assert "endonerf_pulling, blocks of 8 frames" in interpolation.table(found).split("Not measured yet: ")[1]
