"""The page of an inspection: whole, self-contained, safe against odd titles, and true to verdicts and plan."""

import numpy as np
import pytest

from endotsr.clips.effects.frames import ReducedFrames
from endotsr.clips.effects.inspect import Inspection
from endotsr.clips.effects.noise import Noise
from endotsr.clips.effects.periodic import Line
from endotsr.clips.effects.plan import Change, Dictionary, Plan
from endotsr.clips.effects.verdict import Curve, EffectVerdict, Map
from endotsr.method.equations.dictionary import AtomReport
from endotsr.results.report.inspection import inspection_html, inspection_text
from results.report.test_report import Reader, without_pictures
from results.views.browser import seen

WIDTHS = """<pre id="probe"></pre><script>document.getElementById("probe").textContent = JSON.stringify(
{"cut": [...document.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth).length});</script>"""


@pytest.fixture
def found() -> tuple[Inspection, Plan]:
    clip = ReducedFrames(np.full((3, 3, 16, 32), 0.5, np.float32), np.ones((3, 16, 32), bool),
                np.ones((3, 16, 32), np.float32), np.arange(3) / 4, [], 1, 4, 1)  # fmt: skip
    curve = Curve("flow, px", "time", np.arange(3) / 4, {"one": np.arange(3.0), "two": np.ones(3)}, 0.5)
    values = np.full((16, 32), 2.0)
    values[:4] = np.nan
    verdicts = {
        "motion": EffectVerdict("motion", True, "periodic", 3.0, 1.0, "times", "flow", 0.01, "It <moves>.", {}, curve,
                          Map("flow, px", values)),
        "occluders": EffectVerdict("occluders", False, "none", 0.0, 0.0, "fraction", "pixels", 0.0, "None."),
    }  # fmt: skip
    noise = Noise(np.full(3, 0.01), np.full(3, 0.01), "differences over time")
    report = AtomReport(16, 10.0, [], [])
    changes = (
        Change("model.appearance", False, True, "Steady light.", ("photometric",), 0.05, 0.07),
        Change("model.bases", 5, 17, "Slow motion.", ("motion",), 0.0, 0.0, given=True),
    )
    plan = Plan(changes, (("model.deformation", "It <moves>."),), ("Remark.",), Dictionary(8, 16.0, 16, 10.0, report),
                0.05, 0.07)  # fmt: skip
    return Inspection(clip, noise, verdicts, [Line(5.0, 2, 0.9, 1e-9, 0.8)], 20.0), plan


def test_headline_separates_what_was_found_from_what_is_open(found):
    inspection, plan = found
    for kind, said in (("suspected", "Found: motion, occluders."), ("unknown", "Found: motion. Undecided: occluders.")):
        verdict = inspection.verdicts["occluders"]._replace(present=True, kind=kind)
        changed = inspection._replace(verdicts=inspection.verdicts | {"occluders": verdict})
        assert said in Reader(inspection_html("clip", changed, plan)).words


def test_undecided_tests_do_not_make_the_tissue_static(found):
    inspection, plan = found
    still = {name: v._replace(present=False, kind="none") for name, v in inspection.verdicts.items()}
    unknown = still | {"motion": still["motion"]._replace(kind="unknown")}
    for verdicts, said in (
        (still, "No effect was found: to these tests, the tissue is static."),
        (unknown, "No effect was found. Undecided: motion."),
    ):
        assert said in Reader(inspection_html("clip", inspection._replace(verdicts=verdicts), plan)).words


def test_page_holds_verdicts_and_plan_and_nothing_from_outside(found):
    page = inspection_html("clip & <b>", *found)
    words = Reader(page).words
    for word in (
        "clip & <b>",
        "periodic",
        "It <moves>.",
        "model.appearance",
        "Set explicitly, kept. Slow motion.",
        "Remark.",
    ):
        assert any(word in said for said in words), word
    assert "http" not in without_pictures(page) and "<script" not in page
    assert page.count("data:image/png") == 4  # frame, map, and the chart for either colour scheme


def test_text_says_what_the_page_says(found):
    text = inspection_text(*found)
    assert "noise: 2.55 grey levels" in text
    assert "rate: 5 cycles per sequence, 1500 per minute, 2 harmonics" in text
    assert "model.appearance = false (now true), saves 5% time, 7% memory: Steady light." in text
    assert "model.bases = 5 (now 17): Slow motion." in text and "model.deformation is kept: It <moves>." in text


@pytest.mark.slow
@pytest.mark.parametrize("width", [700, 820, 1000])
def test_no_table_is_cut_at_the_side(width, found, tmp_path):
    inspection, plan = found
    motion = inspection.verdicts["motion"]
    wordy = motion._replace(kind="gain + white balance + local", unit="times the threshold of a tile")
    page = inspection_html("clip", inspection._replace(verdicts={"motion": wordy}), plan)
    (tmp_path / "page.html").write_text(page.replace("</body>", WIDTHS + "</body>"), encoding="utf-8")
    assert seen(tmp_path / "page.html", f"--window-size={width},900") == {"cut": 0}


def test_the_savings_say_of_what_they_are_a_part(found):
    """The memory is that of Gaussians and optimiser, not that of an iteration."""
    inspection, plan = found
    wanted = (
        f"{plan.time:.0%} of the time of an iteration and {plan.memory:.0%} of the memory of Gaussians and optimiser"
    )
    assert f"expected saving: {wanted}" in inspection_text(inspection, plan)
    words = Reader(inspection_html("clip", inspection, plan)).words
    assert "expected saving, time of an iteration" in words
    assert "expected saving, memory of Gaussians and optimiser" in words
