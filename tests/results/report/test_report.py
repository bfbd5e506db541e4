"""The report: complete, self-contained, safe against odd text, written whole or not at all."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from endotsr.results.report import figures
from endotsr.results.report.data import FramePictures, Preview, ReportData
from endotsr.results.report.run_text import facts, held_out_table, interpolation_sentence
from endotsr.results.report.sections import report_html

VOID = {"meta", "img", "source", "br"}


class Reader(HTMLParser):
    """Checks that tags close in order; collects tags, attributes and cell texts."""

    def __init__(self, page):
        super().__init__()
        self.open, self.tags, self.attributes, self.words = [], [], [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip() and "style" not in self.open:
            self.words.append(data.strip())


def without_pictures(page):
    return re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)


def metrics(value):
    return {"psnr_full": value + 1.8, "psnr_tissue": value, "ssim_full": 0.9671, "lpips": None}


ABOUT = {
    "source": "clip", "frames": 9, "width": 32, "height": 24, "training_frames": 5, "held_out_frames": 4,
    "tissue_fraction": 0.875, "files_sha256": {"images/a.png": "ab" * 32},
}  # fmt: skip
RUN = {
    "iteration": 20, "iterations_planned": 30, "gaussians": 5, "seed": 0, "threads": 2, "seconds": 61.0,
    "peak_memory_bytes": None, "lambda_lap": None, "versions": {"numpy": "2.1"}, "input": ABOUT,
    "machine": {"processor": "two cores", "cores": 2, "system": "Linux"},
}  # fmt: skip


def made_up_data(**changes):
    rng = np.random.default_rng(0)
    mask = np.ones((24, 32), bool)
    mask[:, :4] = False
    frames = []
    for index, error in ((1, 0.01), (9, 0.1), (17, 0.05), (25, 0.02)):
        truth = rng.uniform(0.3, 0.6, (3, 24, 32))
        depth = rng.uniform(40, 90, (24, 32))
        frames.append(FramePictures(index, f"f{index}.png", index / 63, truth + error, truth, mask, depth, metrics(30)))
    rows = [{"frame": f.index, **metrics(30 + f.index / 10)} for f in frames]
    baselines = {
        "two_neighbours": {"label": "Blend of two", "mean": metrics(31.0), "per_frame": rows},
        "temporal_mean": {"label": "Temporal mean", "mean": metrics(20.0), "per_frame": rows},
    }
    evaluation = {
        "held_out": {"mean": metrics(30.25), "per_frame": rows},
        "training": {"mean": metrics(35.25)},
        "baselines": baselines,
        "components": [{"label": "whole", "psnr_tissue": 30.0}, {"label": "without A", "psnr_tissue": 29.5}],
        "run": RUN,
        "lpips_reason": "no weights file was given",
        "not_finite": 2,
    }
    values = {
        "title": "made up",
        "evaluation": evaluation,
        "log": [],
        "frames": tuple(frames),
        "configuration": 'preset = "paper"\n',
    }
    return ReportData(**(values | changes))


LOG = [{"iteration": k, "loss": 1 / k, "psnr": 20.0 + k, "gaussians": 1234 + k} for k in range(1, 9)]


@pytest.fixture(scope="module")
def page():
    return report_html(made_up_data(log=LOG))


def test_page_needs_nothing_but_itself(page):
    assert "http" not in without_pictures(page) and "//" not in without_pictures(page)
    reader = Reader(page)
    assert not {"script", "link", "iframe", "object"} & set(reader.tags)
    for name, value in reader.attributes:
        if name in ("src", "srcset", "href"):
            assert value.startswith("data:image/")
    assert "url(" not in page and "@import" not in page


def test_every_embedded_picture_can_be_decoded(page):
    found = re.findall(r"data:image/(\w+);base64,([A-Za-z0-9+/=]+)", page)
    assert len(found) >= 4 * 4 * 2 + 2 * 4
    for kind, content in found:
        picture = Image.open(io.BytesIO(base64.b64decode(content, validate=True)))
        picture.load()
        assert picture.format == kind.upper()
        assert b"http" not in base64.b64decode(content)  # writers like to sign their files with an address


@pytest.mark.parametrize("faded, said", [(29.0, "1.25 dB above"), (31.0, "0.75 dB below")])
def test_the_page_says_whether_the_motion_carries_information(faded, said):
    evaluation = made_up_data().evaluation
    ours = evaluation["held_out"]["mean"]["psnr_tissue"]
    row = {"label": "Blend of its own renders", "mean": metrics(faded) | {"psnr_tissue": ours - 30.25 + faded}}
    motion = {"scene_units": 0.25, "pixels": 0.5, "motion_scene_units": 1.0, "motion_pixels": 2.0, "unit": "mm"}
    words = " ".join(
        Reader(report_html(made_up_data(evaluation=evaluation | {"cross_fade": row, "trajectories": motion}))).words
    )
    assert "Blend of its own renders" in words and said in words
    what = "raise" if faded < 30.25 else "do not raise"
    assert f"its changes of position and colour between them {what} the PSNR" in words
    assert "Mean trajectory error 0.250 mm (0.50 px); mean tissue motion 1.000 mm (2.00 px)" in words


def test_tables_hold_the_numbers(page):
    words = " ".join(Reader(page).words)
    for word in ("This model", "Blend of two", "Temporal mean", "30.25", "32.05", "0.9671"):
        assert word in words, word
    for word in (
        "without A",
        "29.50",
        "−0.50 dB",
        "Seed",
        "two cores",
        'preset = "paper"',
        "ab" * 32,
        "numpy 2.1",
        "1:01",
    ):
        assert word in words, word
    assert page.count("<table") == 4


def test_temporal_gap_is_training_minus_held_out(page):
    words = Reader(page).words
    at = words.index("Temporal gap")
    row = words[words.index("PSNR tissue, dB", at) :][:4]
    assert row[1:] == ["35.25", "30.25", "5.00"]


def test_verdict_names_the_strongest_baseline(page):
    assert "0.75 dB below" in page and "blend of two" in page and "above 1 of 2 baselines" in page


@pytest.mark.parametrize("blend, lpips, said", [
    (30.25, (None, None), ""),
    (29.9, (0.02, 0.01), ""),
    (30.26, (None, None), "Interpolation suffices {} reaches 30.26 dB on tissue, this model 30.25 dB."),
    (42.8, (0.0366, 0.009),
        "Interpolation suffices {} 42.80 dB on tissue, this model 30.25 dB (LPIPS 0.0090 and 0.0"),
    (42.8, (0.009, 0.0366), "In PSNR, interpolation suffices {} this model 30.25 dB (LPIPS 0.0366 and 0.0090)."),
])  # fmt: skip
def test_the_page_says_where_interpolation_suffices(blend, lpips, said):
    """The rows of the report's own table decide: the blend against the model on tissue, and their LPIPS."""
    data = made_up_data()
    for entry, value, distance in (
        (data.evaluation["held_out"], 30.25, lpips[0]),
        (data.evaluation["baselines"]["two_neighbours"], blend, lpips[1]),
    ):
        entry["mean"] = metrics(value) | {"lpips": distance}
    sentence = interpolation_sentence(data.evaluation)
    assert all(part in sentence for part in said.split(" {} ")) and bool(sentence) == bool(said)
    assert sentence in report_html(data) and ("suffices" in report_html(data)) == bool(said)
    assert sentence in held_out_table(data.evaluation)


def test_a_model_below_the_blend_on_its_training_frames_is_said_not_to_be_fitted():
    data = made_up_data()
    data.evaluation["held_out"]["mean"] = metrics(28.0)
    data.evaluation["baselines"]["two_neighbours"]["mean"] = metrics(32.0)
    for fitted, said in ((31.99, True), (32.0, False)):
        data.evaluation["training"]["mean"] = metrics(fitted)
        end = f"{fitted:.2f} dB on its own training frames; a longer training may change this."
        assert interpolation_sentence(data.evaluation).endswith(end) == said


def test_no_verdict_against_a_baseline_without_a_value():
    """Infinite PSNR (a still scene) is no value: saying "above the strongest" would be false."""
    data = made_up_data()
    data.evaluation["baselines"]["temporal_mean"]["mean"]["psnr_tissue"] = None
    assert "the model is" not in report_html(data)


def test_frames_come_worst_first(page):
    assert re.findall(r"<summary>Frame (\d+)", page) == ["9", "17", "25", "1"]
    assert page.count("<details open>") == 3


def test_a_render_that_is_not_finite_is_the_worst_frame():
    data = made_up_data()
    data.frames[0].render[0, 5, 9] = np.nan
    page = report_html(data)
    assert re.findall(r"<summary>Frame (\d+)", page)[0] == "1"
    assert "nan" not in " ".join(Reader(page).words).lower()


def test_absent_values_are_a_dash_with_a_reason(page):
    assert "no weights file was given" in page and "2 values were not finite and are shown" in page
    one = made_up_data(evaluation=made_up_data().evaluation | {"not_finite": 1})
    assert "1 value was not finite and is shown as a dash" in report_html(one)
    assert not re.search(r"\b(nan|inf|None)\b", " ".join(Reader(page).words))


def test_a_frame_without_tissue_is_named():
    rows = [{"frame": 3, "name": "right", "psnr_tissue": 30.0}, {"frame": 5, "name": "covered", "psnr_tissue": None}]
    evaluation = {"held_out": {"mean": {"psnr_tissue": 30.0}, "per_frame": rows}, "baselines": {}}
    page = report_html(ReportData(title="x", evaluation=evaluation))
    assert "excluded from the tissue means (no finite value): covered." in page


def test_additional_measurements_have_tables_with_units():
    depth = {"unit": "mm", "rows": [
        {"label": "this model", "mean_absolute": 1.25, "covered": 0.5}, {"label": "prior", "mean_absolute": 0.75},
    ]}  # fmt: skip
    flicker = {"rows": [{"label": "this model", "all_frames": 0.5, "held_out": None}], "left_out": ["<f4>"]}
    found = {"depth": depth, "flicker": flicker, "right_view": {"reason": "no <right>"}}
    page = report_html(made_up_data(evaluation=made_up_data().evaluation | {"measures": found}))
    words = Reader(page).words
    start = words.index("Additional measurements")
    assert [word.replace("\u00a0", " ") for word in words[start + 2 : start + 11]] == [
        "Depth", "mean error, mm", "covered, %", "this model", "1.25", "50", "prior", "0.75", "–",
    ]  # fmt: skip
    assert "all frames, grey levels" in page and "left out: &lt;f4&gt;." in page
    assert "<b>Right view</b> was not measured: no &lt;right&gt;." in page
    assert "Additional measurements" not in report_html(made_up_data())


def test_text_cannot_break_the_page():
    evil = '<script>alert("x")</script>&"\''
    about = {"source": evil, "notes": [evil], "files_sha256": {evil: evil}}
    run = RUN | {"versions": {evil: evil}, "machine": {"processor": evil, "system": evil}, "input": about}
    evaluation = made_up_data().evaluation | {"run": run, "components": [{"label": evil, "psnr_tissue": 30.0}]}
    page = report_html(made_up_data(title=evil, evaluation=evaluation, configuration=evil, depth_unit=evil))
    assert page.count("&lt;script&gt;") >= 9
    assert "script" not in Reader(page).tags


@pytest.mark.parametrize("data", [ReportData("bare"), made_up_data(evaluation={}), made_up_data(log=LOG, frames=())])
def test_missing_parts_are_left_out(data):
    reader = Reader(report_html(data))
    assert data.title in reader.words


def moving_picture(count):
    """An animated WebP of grey pictures."""
    pictures, out = [Image.new("RGB", (20, 10), (40 * k,) * 3) for k in range(count)], io.BytesIO()
    pictures[0].save(out, "WEBP", save_all=count > 1, append_images=pictures[1:])
    return out.getvalue()


def test_the_scene_moves_and_its_viewer_is_one_link_away():
    preview = Preview(moving_picture(3), moving_picture(1), 20, 10, "moving & turning")
    page = report_html(made_up_data(preview=preview, viewer="view.html"))
    reader = Reader(page)
    assert [value for name, value in reader.attributes if name == "href"] == ["view.html"]
    moving = re.search(r'<img src="data:image/webp;base64,([^"]*)" alt="moving &amp; turning" width="20"', page)
    still = re.search(r'prefers-reduced-motion: reduce\)" srcset="data:image/webp;base64,([^"]*)"', page)
    counts = [Image.open(io.BytesIO(base64.b64decode(found[1]))).n_frames for found in (moving, still)]
    assert counts == [3, 1]
    assert "Open the viewer" not in report_html(made_up_data(preview=preview))


def test_columns_of_8_bits_are_folded():
    data = made_up_data()
    data.evaluation["held_out"]["mean"] |= {"psnr_full_8bit": 31.71, "psnr_tissue_8bit": 30.19}
    page = report_html(data)
    shown, _, folded = page.partition("<summary>With renders rounded to 8 bits")
    table = shown[shown.index("Held-out frames, compared with baselines") :]
    assert "8‑bit" not in table and "31.71" not in table and "30.25" in table
    opened = folded[: folded.index("</details>")]
    assert "31.71" in opened and "30.19" in opened and "30.25" not in opened


def test_extrapolated_frames_stand_in_a_table_of_their_own():
    data = made_up_data()
    assert "extrapolated" not in report_html(data)
    data.evaluation["frames"] = {"extrapolated": [25]}
    page = report_html(data)
    shown, _, apart = page.partition("1 further held-out frame is extrapolated")
    within = np.mean([30 + k / 10 for k in (1, 9, 17)])
    assert f"{within:.2f}" in shown and "32.50" not in shown[shown.index("<table") :] and "30.25" not in shown
    assert "(25)" in apart and "32.50" in apart[: apart.index("</table>")]
    assert "1 of them extrapolated and not in these means" in shown
    data.evaluation["frames"] = {"extrapolated": [1, 9, 17, 25]}
    assert "Every held-out frame is extrapolated" in report_html(data) and "30.25" in report_html(data)


def test_nothing_is_said_of_frames_between_where_every_frame_is_extrapolated():
    """With the split `end` the blend is a copy of the last training frame, and the cross-fade a copy of its render."""
    data = made_up_data()
    data.evaluation["cross_fade"] = {"label": "Faded", "mean": metrics(31.0)}
    assert interpolation_sentence(data.evaluation) and "between them do not raise the PSNR" in report_html(data)
    data.evaluation["frames"] = {"extrapolated": [1, 9, 17, 25]}
    page = report_html(data)
    assert interpolation_sentence(data.evaluation) == "" and "suffices" not in page and "between them gain" not in page


def test_pixels_that_training_hardly_shows_are_marked_and_left_out_in_a_table():
    data = made_up_data()
    assert "Never seen in training" not in report_html(data) and "hardly shows" not in report_html(data)
    seen = np.full((24, 32), 5, np.int32)
    seen[2, 10], seen[3, 11:13] = 0, 1
    rows = [{"frame": 1, "tissue": 672, "never_seen": 1, "seen_once": 2}]
    data.evaluation["frames"] = {"coverage": rows}
    data.evaluation["held_out"]["mean"] |= {"psnr_seen": 30.31, "psnr_seen_twice": 30.47}
    page = report_html(replace(data, frames=(replace(data.frames[0], seen=seen), *data.frames[1:])))
    folded = page[page.index("Without pixels that training hardly shows") :]
    folded = folded[: folded.index("</details>")]
    assert "1 (0.15%) are excluded in every" in folded and "2 (0.30%) are tissue in one" in folded
    assert "30.25" in folded and "30.31" in folded and "30.47" in folded
    assert "Never seen in training" in page and "Seen once" in page and page.count("<span>Seen</span>") == 1
    assert "3 px never seen in training or once" in page


def test_the_counts_of_seldom_seen_pixels_are_of_the_frames_of_their_table():
    """Where extrapolated frames are apart, the PSNR beside the counts is not theirs."""
    data = made_up_data()
    rows = [{"frame": frame, "tissue": 672, "never_seen": frame, "seen_once": 2} for frame in (1, 9, 17, 25)]
    data.evaluation["frames"] = {"coverage": rows, "extrapolated": [25]}
    page = report_html(data)
    assert f"Of {3 * 672} tissue pixels" in page and "27 (1.34%) are excluded" in page
    data.evaluation["frames"]["extrapolated"] = []
    assert f"Of {4 * 672} tissue pixels" in report_html(data)


def test_the_time_of_a_training_that_has_not_ended_is_not_said_to_be_nothing():
    data = made_up_data()
    for seconds in (None, 0.0):
        data = replace(data, evaluation=data.evaluation | {"run": RUN | {"seconds": seconds}})
        assert "0:00" not in report_html(data) and facts(data.evaluation["run"])["Training time"] is None
    assert facts(RUN)["Training time"] == "1:01" and "1:01" in report_html(made_up_data())


def test_the_picture_marks_exactly_the_seldom_seen_tissue():
    seen = np.full((24, 32), 5, np.int32)
    seen[2, 10], seen[3, 11:13], seen[4, 1] = 0, 1, 0  # the last one is excluded
    mask = np.ones((24, 32), bool)
    mask[:, :4] = False
    picture = figures.seen_picture(np.full((3, 24, 32), 0.5), mask, seen)
    for times, colour in figures.SELDOM_SEEN.items():
        np.testing.assert_array_equal((picture == colour).all(axis=2), mask & (seen == times))
    assert (picture[~mask] == figures.EXCLUDED).all()


def test_the_report_says_that_it_shows_the_worst_of_more_frames():
    data = made_up_data()
    assert "worst of" not in report_html(data)
    assert "The 2 worst of 4 frames; see renders/ for all of them." in report_html(
        replace(data, frames=data.frames[:2])
    )
