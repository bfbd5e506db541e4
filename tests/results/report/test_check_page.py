from endotsr.clips.sequences.checks.check import Checked
from endotsr.clips.sequences.checks.kinds import finding
from endotsr.results.report.check_page import check_page


def test_reasons_and_remedies_keep_their_capital_letters():
    found = [finding(code, "clip", "odd") for code in ("inverted-masks", "blue-pictures", "disk")]
    page = check_page(Checked("clip", found, {}, []))
    assert "Read them the other way: endotsr prepare SOURCE --masks FOLDER --excluded-value black." in page
    assert "Tissue is red: red and blue may be exchanged, as OpenCV stores them." in page
    assert "<b>endotsr prepare --scale 0.5, or fewer --frames.</b>" in page
