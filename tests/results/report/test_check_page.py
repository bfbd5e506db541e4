from endotsr.clips.sequences.checks.check import Checked
from endotsr.clips.sequences.checks.kinds import KINDS, finding
from endotsr.results.report.check_page import check_page


def test_reasons_and_remedies_keep_their_capital_letters():
    found = [finding(code, "clip", "odd") for code in ("inverted-masks", "blue-pictures", "disk")]
    page = check_page(Checked("clip", found, {}, []))
    assert "Read them the other way: endotsr prepare SOURCE --masks FOLDER --excluded-value black." in page
    assert "Tissue is red: red and blue may be exchanged, as OpenCV stores them." in page
    assert "<b>endotsr prepare --scale 0.5, or fewer --frames.</b>" in page


def test_one_finding_is_not_said_as_several():
    page = check_page(Checked("clip", [finding("disk", "clip", "odd")], {}, []))
    assert "1 refusal, 0 warnings, 0 notes" in page


def test_the_cost_has_units():
    cost = {"sequence_bytes": 4423680.0, "total_bytes": 880056000.0, "file_bytes": 0.0, "minutes": 5.81,
            "command_minutes": 126.4, "gaussians": 64000}  # fmt: skip
    page = check_page(Checked("clip", [], {"frames": 24, "cost": cost}, []))
    for label, value in (("frames as they are read", "4.4 MB"), ("memory of a training", "0.9 GB"),
                         ("iterations", "5.8 minutes"), ("whole command, without compilation", "126 minutes"),
                         ("Gaussians at the end", "64&#8239;000"), ("frames", "24")):  # fmt: skip
        assert f"<dt>{label}</dt><dd>{value}</dd>" in page
    assert "file of the frames" not in page, "they are in memory"


def test_a_clip_that_ends_the_check_early_is_not_said_to_be_checked_for_everything():
    """A refused folder without pictures is checked for little more than its layout."""
    page = check_page(Checked("clip", [finding("disk", "clip", "odd")], {}, []))
    assert "were checked" not in page and f"{len(KINDS)} kinds of findings" in page
