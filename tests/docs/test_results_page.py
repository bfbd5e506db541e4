"""docs/results/README.md: its tables are what the committed results say."""

import json
from pathlib import Path
from statistics import fmean

import pytest
from pages.full_size import interpolation, levers

RESULTS = Path(__file__).parents[2] / "docs" / "results"


@pytest.mark.parametrize(
    "study, name", [(study, name) for study, about in levers.STUDIES.items() for name in about.tables]
)
def test_a_table_of_the_levers_is_what_the_result_says(study, name):
    about = levers.STUDIES[study]
    found = json.loads(about.file.read_text(encoding="utf-8"))
    assert about.tables[name](found) in about.page.read_text(encoding="utf-8")


def test_the_readme_says_which_preset_has_the_smaller_error():
    """Measured with `sharp` alone: the README may say it of that preset, and only while it is true."""
    found = json.loads((RESULTS / "against_flow.json").read_text(encoding="utf-8"))
    both = [row for name, row in found["pixels"].items() if name != "excluded"]
    below = sum(row["model"] for row in both) < sum(row["flow"] for row in both)
    words = " ".join((RESULTS.parents[1] / "README.md").read_text(encoding="utf-8").split())
    assert below == ("the preset `sharp` has a smaller squared error than flow" in words)
    assert "the model has the smaller squared error" not in words


def tissue(name):
    """Held-out PSNR on tissue of a recorded run and of flow, dB."""
    found = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    flow = found["baselines"]["flow_interpolation"]
    return found["held_out"]["mean"]["psnr_tissue"], flow["mean"]["psnr_tissue"]


def test_the_readme_compares_with_flow_as_recorded():
    words = " ".join((RESULTS.parents[1] / "README.md").read_text(encoding="utf-8").split())
    model = fmean(tissue(f"pulling_sharp_seed{seed}")[0] for seed in range(3))
    assert f"{tissue('pulling_sharp_seed0')[1]:.2f} dB on tissue against {model:.2f} dB" in words
    ahead = {gap: tissue(f"pulling_sharp_blocks{gap}") for gap in (4, 8, 16)}
    ahead = {gap: model - flow for gap, (model, flow) in ahead.items()}
    assert max(abs(ahead[4]), abs(ahead[8])) < 0.2 and "differ by less than 0.2 dB" in words
    assert f"the scene is {ahead[16]:.1f} dB ahead" in words


def test_the_readme_states_the_minutes_that_were_timed():
    rows = json.loads((RESULTS / "minutes.json").read_text(encoding="utf-8"))["rows"]
    minutes = {name: round(rows[name][-1]["seconds"] / 60) for name in ("quick", "sharp", "paper")}
    readme = (RESULTS.parents[1] / "README.md").read_text(encoding="utf-8")
    assert minutes == {"quick": 1, "sharp": 5, "paper": 7}
    for words in (
        "the best picture: five minutes",
        "a first look in about one minute",
        "without a preset: seven minutes",
    ):
        assert words in readme


def test_differences_are_paired_by_seed():
    """The same offset on both seeds has no width, however far apart the seeds are."""
    runs = {
        levers.SHARP: [{"psnr_tissue": 30.0}, {"psnr_tissue": 40.0}],
        levers.PAPER: [{"psnr_tissue": 29.0}, {"psnr_tissue": 39.0}],
    }
    found = {"scenes": {"clip": runs}, "seeds": 2, "iterations": 9, "date": "-", "machine": {"processor": "x"}}
    rows = [line for line in levers.table(found).splitlines() if line.startswith("| clip")]
    assert rows == ["| clip | `sharp` | 35.00 | - |", "| clip | `paper` | -1.00 ± 0.00 | - |"]


def test_the_table_of_interpolation_is_what_its_record_says():
    found = json.loads((RESULTS / "interpolation.json").read_text(encoding="utf-8"))
    assert interpolation.table(found) in interpolation.PAGE.read_text(encoding="utf-8")
