"""The independent mistakes: they fit their port, cover every operation, and a handful is recognised as the record says.

All of them: python tests/port/unseen/by_hand/measure.py --record now
"""

import json
from collections import Counter

import constants
import hand_port
import measure
import pytest

ENTRIES = {entry["id"]: entry for entry in measure.mistakes()}
RUNS = json.loads(measure.RECORD.read_text(encoding="utf-8"))
LAST = RUNS.get("now", RUNS["before"])
HANDFUL = ("bases_exchanged", "penalty_by_3nf", "sign_in_g_v", "alpha_not_clamped", "half_after_the_clamp")
RECOGNISED = ("explained", "named", "told")
HOLES = {  # what ports that passed all cases of 3.1 got wrong
    "appearance/deep_saturation": ["slope = 4 * e / (1 + e) ** 2", "slope = 1 - np.tanh(x) ** 2"],
    "pose/zero": ["if r < 1:", "if r < 0:"],
    "pose/tiny": ["if r < 1:", "if r == 0:"],
    "composite/faint": ["return image, far, sum_, left", "return image, far, 1 - left, left"],
    "density/hidden": ["visits = i[\"visible\"].sum(0)", "visits = (norms > 0).sum(0)"],
    "deformation/cut_quartic": ["np.where(u**2 > 60 * np.log(2)", "np.where(u**2 > np.inf"],
    "adam/other_settings": ["m_hat / (np.sqrt(v_hat) + s[\"epsilon\"])",
                            "m_hat * np.sqrt(1 - beta2**k) / (np.sqrt(v) + s[\"epsilon\"])"],
    "exposure/bright": ["exposed = gain * i[\"colour\"] + i[\"bias\"][:, None, None]",
                        "exposed = np.minimum(gain * i[\"colour\"] + i[\"bias\"][:, None, None], 1)"],
}  # fmt: skip


@pytest.mark.parametrize("case", HOLES)
def test_a_case_refuses_what_ports_got_wrong_unnoticed(case):
    assert case in constants.refusing(measure.GOLDEN, [HOLES[case]])


def test_the_port_by_hand_is_right():
    report = measure.report_on(())
    assert report.level == 3 and report.diagnosis == [] and report.suspects == []


def test_every_mistake_fits_the_port_once_and_every_operation_has_some():
    assert len(ENTRIES) == len(measure.mistakes()) >= 120
    for entry in ENTRIES.values():
        assert hand_port.sources(entry["edit"]) != hand_port.sources(), entry["id"]
        assert entry["text"].endswith(".") and entry["says"]
    later = {"registration"}  # (B19) is younger than the set, which is not added to
    operations = set(hand_port.OPERATIONS) - {"reading", "generator"} - later
    assert set(Counter(e["operation"] for e in ENTRIES.values())) == operations


def test_an_edit_that_does_not_stand_once_is_an_error():
    with pytest.raises(ValueError, match="places in the port by hand"):
        hand_port.sources([("np", "numpy")])


def test_the_notes_beside_the_set_are_on_its_entries():
    for table in measure.KNOWN.values():
        assert set(table) <= set(ENTRIES)
    for run in RUNS.values():
        assert sorted(one for ids in run["outcomes"].values() for one in ids) == sorted(ENTRIES)


@pytest.mark.parametrize("name", HANDFUL)
def test_the_record_is_that_of_this_judge(name):
    found = measure.one(ENTRIES[name])
    kind = next(kind for kind, ids in LAST["outcomes"].items() if name in ids)
    known = kind in RECOGNISED, name not in LAST["another operation first"]
    assert (found.outcome in RECOGNISED, found.operation) == known, found.said


def test_words_of_an_entry():
    entry = {"says": ["octave|frequenc & (ratio|log)", r"\bb1\b"]}
    assert measure.has_words(entry, "Frequencies of equal ratio") and measure.has_words(entry, "octaves")
    assert not measure.has_words(entry, "frequencies") and not measure.has_words(entry, "sub1")
    assert not measure.has_words(entry, "octaves: times 2", "times 2")
    assert measure.interval(50, 100) == pytest.approx((0.4038, 0.5962), abs=1e-4)


def test_every_constant_is_moved_by_the_cases_that_the_page_names():
    text = constants.PAGE.read_text(encoding="utf-8")
    for row in constants.rows_of_constants(measure.GOLDEN):
        assert row[2], f"{row[0]}: no case refuses another value"
        assert f"| {' | '.join(row)} |\n" in text, row


def test_the_page_names_every_setting():
    text = constants.PAGE.read_text(encoding="utf-8")
    for setting in (*constants.hard_coded.wanted_settings(), *constants.hard_coded.FREE):
        assert f"\n| `{setting}` | " in text, setting


def test_a_setting_that_no_case_moves_ends_the_writer_of_the_page(tmp_path, monkeypatch):
    row = constants.hard_coded.Row("loss.new", {"0.0": ""})
    monkeypatch.setattr(constants.hard_coded, "table", lambda golden: [row])
    monkeypatch.setattr(constants, "PAGE", tmp_path / "SETTINGS.md")
    with pytest.raises(SystemExit, match=r"(?s)^error: loss\.new: .*hard_coded\.py$"):
        constants.main()
    assert not constants.PAGE.exists()
