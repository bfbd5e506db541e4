"""Chapter 0 quotes other pages: it says what their generated tables say."""

import json
import re
from pathlib import Path

from pages.store.intervals import interval

ROOT = Path(__file__).parents[2]
WORDS = " ".join(
    re.sub(r"^# ?", "", (ROOT / "notebooks" / "00_why.py").read_text(encoding="utf-8"), flags=re.M).split()
)


def block(page: str, name: str) -> str:
    """The generated part of a page."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    return text.split(f"<!-- {name}:start -->")[1].split(f"<!-- {name}:end -->")[0]


def row(table: str, *starts: str) -> list[str]:
    """The cells of the one row whose first cells are these."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line[:1] == "|"]
    (found,) = [cells for cells in rows if cells[: len(starts)] == list(starts)]
    return found


def test_the_loss_of_a_on_the_simulated_clip():
    change = float(row(block("claims", "claims:simulated_paper"), "A alone (ours)", "PSNR full, dB")[2])
    assert change < 0 and "A loses PSNR on held-out frames" in WORDS


def test_the_gain_of_a_on_the_real_clip():
    gain = float(row(block("claims", "claims:pulling"), "A added to S", "PSNR full, dB")[2])
    assert gain > 0 and "adding A to S gains PSNR" in WORDS


def test_the_gain_of_the_residuals_in_a_short_training():
    change = float(row(block("tradeoff", "tradeoff:training").split("**simulated**")[0], "no residuals")[2])
    assert change < -1 and "a model without residuals is much worse" in WORDS
    assert "721 iterations" in WORDS and "scaled to 721 iterations" in block("tradeoff", "tradeoff:training")


def test_false_motion_is_the_same_with_and_without_a():
    light = block("effects", "effects:truth").split("| Motion alone")[0]
    assert row(light, "`paper`")[3:5] == row(light, "`paper` without A")[3:5]
    assert "false motion is the same with and without A" in WORDS


def test_light_alone_resolves_no_difference_of_psnr():
    light = json.loads((ROOT / "docs/results/effects_truth.json").read_text(encoding="utf-8"))["scenes"]["light"]
    pairs = zip(light["`paper`"], light["`paper` without A"], strict=True)
    mean, half = interval([a["psnr"] - b["psnr"] for a, b in pairs])
    assert abs(mean) < half and len(light["`paper`"]) == 3
    assert "the interval of the difference contains 0" in WORDS
