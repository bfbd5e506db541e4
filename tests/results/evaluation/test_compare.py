"""Paired differences: known means, an interval that covers the truth as often as it says, and refusals."""

import csv
import io

import numpy as np
import pytest

from endotsr.errors import InputError
from endotsr.results.evaluation.compare import Method, compare, interval, methods_of
from endotsr.results.report.comparison import comparison_csv, comparison_table, frames_csv

DIGESTS = {"images": "a", "masks": "b"}


def method(label, values, digests=DIGESTS, **more):
    rows = [{"frame": k, "name": f"f{k}", "time": k / 9, "psnr_tissue": v} for k, v in enumerate(values)]
    for name, column in more.items():
        for row, value in zip(rows, column):
            row[name] = value
    return Method(label, rows, digests)


def test_differences_are_paired_by_frame():
    rows = compare(
        [
            method("a", [10.0, 30.0, 20.0], lpips=[0.1, 0.2, 0.3]),
            method("b", [11.0, 31.5, None], lpips=[0.2, 0.1, 0.1]),
        ],
        ("psnr_tissue", "lpips", "ssim_full"),
    )
    by = {(row.label, row.metric): row for row in rows}
    assert set(by) == {(label, metric) for label in "ab" for metric in ("psnr_tissue", "lpips")}
    assert by["a", "psnr_tissue"].mean == 20 and by["a", "psnr_tissue"].difference is None
    psnr, lpips = by["b", "psnr_tissue"].difference, by["b", "lpips"].difference
    assert (psnr.mean, psnr.better, psnr.frames) == (1.25, 2, 2) and 1.0 <= psnr.low <= psnr.mean <= psnr.high <= 1.5
    assert lpips.mean == pytest.approx(-0.2 / 3) and (lpips.better, lpips.frames) == (2, 3), "smaller is better"


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hits = sum(low <= 0.5 <= high for low, high in (interval(rng.normal(0.5, 1, 30), k) for k in range(60)))
    assert 52 <= hits <= 60  # 0.95 of 60 is 57; a percentile interval of 30 values covers a little less
    assert interval(np.arange(5.0), 3) == interval(np.arange(5.0), 3)
    assert interval(np.array([0.7])) == (0.7, 0.7)


def test_one_clip_in_two_layouts_is_compared():
    """The frames have other names there; frames and masks are the same, bit by bit."""
    other = method("b", [1.0, 2.0, 4.0])
    renamed = other._replace(per_frame=[row | {"name": f"frame-{row['frame']:06d}.color"} for row in other.per_frame])
    rows = compare([method("a", [1.0, 2.0, 3.0]), renamed], ("psnr_tissue",))
    assert rows[1].difference.mean == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (method("b", [1.0, 2.0]), "b: 2 frames from f0 to f1; a: 3 frames from f0 to f2; use the same held-out"),
        (method("a", [1.0, 2.0, 3.0]), "two methods are called 'a'; use NAME=PATH"),
        (method("b", [1.0, 2.0, 3.0], {"images": "a", "masks": "c"}), "b and a: measured on different masks"),
    ],
)
def test_methods_that_cannot_be_compared_are_refused(other, said):
    with pytest.raises(InputError) as refused:
        compare([method("a", [1.0, 2.0, 3.0]), other], ("psnr_tissue",))
    assert said in str(refused.value)


@pytest.mark.parametrize("metrics", [{}, {"held_out": {}}, {"held_out": {"per_frame": [{"frame": 1}]}}, {"run": 3}])
def test_files_that_are_no_metrics_are_refused(metrics):
    with pytest.raises(InputError, match=r"found\.json: .*use a file that `endotsr evaluate` wrote"):
        methods_of(metrics, "a", "found.json")


@pytest.mark.parametrize("value", ["30", [30.0], True, {}])
def test_a_metric_that_is_no_number_is_refused(value):
    rows = [{"frame": 1, "name": "f1", "time": 0.5, "psnr_tissue": value}]
    metrics = {"pictures": {"arrays_sha256": DIGESTS}, "held_out": {"per_frame": rows}}
    with pytest.raises(InputError, match=r"found\.json: frame 1: psnr_tissue: .* is not allowed"):
        methods_of(metrics, "a", "found.json")


def test_a_method_with_the_name_of_a_baseline_keeps_its_own_numbers():
    """It is refused beside this baseline; before, the numbers of the baseline took its place."""
    rows = [{"frame": 1, "name": "f1", "time": 0.5, "psnr_tissue": value} for value in (30.0, 20.0)]
    metrics = {
        "pictures": {"arrays_sha256": DIGESTS},
        "held_out": {"per_frame": rows[:1]},
        "baselines": {"x": {"label": "X", "per_frame": rows[1:]}},
    }
    assert [m.per_frame[0]["psnr_tissue"] for m in methods_of(metrics, "X", "found.json", baselines=True)] == [30, 20]
    with pytest.raises(InputError, match="two methods are called 'X'"):
        compare(methods_of(metrics, "X", "found.json", baselines=True), ("psnr_tissue",))


def test_a_single_frame_has_no_interval():
    """Of a clip of three frames one is held out; limits that equal the difference would claim that it is certain."""
    rows = compare([method("a", [10.0]), method("b", [11.0])], ("psnr_tissue",))
    assert (rows[1].difference.mean, rows[1].difference.low, rows[1].difference.high) == (1.0, None, None)
    line = comparison_table(rows).splitlines()[-1].split()
    assert line == ["b", "PSNR", "tissue", "+1.00", "-", "1", "of", "1", "frames"]
    (_, cells) = csv.DictReader(io.StringIO(comparison_csv(rows)))
    assert (cells["difference"], cells["low"], cells["high"]) == ("1.0", "", "")


def test_extrapolated_frames_have_means_and_differences_of_their_own():
    """As in the report: behind the last training frame a model predicts, and between two it interpolates."""
    a, b = method("a", [30.0, 32.0, 20.0]), method("b", [31.0, 33.0, 16.0])
    rows = compare([a._replace(outside=(2,)), b._replace(outside=(2,))], ("psnr_tissue",))
    found = {(row.label, row.extrapolated): row for row in rows}
    assert [found["a", which].mean for which in (False, True)] == [31, 20]
    assert [found["b", which].difference.mean for which in (False, True)] == [1, -4]
    table = comparison_table(rows)
    assert table.index("held-out frames between training frames") < table.index("mean over the extrapolated frames")
    cells = list(csv.DictReader(io.StringIO(comparison_csv(rows))))
    assert [row["extrapolated"] for row in cells] == ["0", "0", "1", "1"]
    (alone,) = compare([a._replace(outside=(0, 1, 2))], ("psnr_tissue",))
    assert alone.extrapolated and comparison_table([alone]).startswith("mean over the extrapolated frames")


def test_the_extrapolated_frames_of_a_file_are_read():
    rows = [{"frame": k, "name": f"f{k}", "time": k / 2, "psnr_tissue": 30.0} for k in (0, 1)]
    metrics = {"pictures": {"arrays_sha256": DIGESTS}, "held_out": {"per_frame": rows}, "frames": {"extrapolated": [1]}}
    (found,) = methods_of(metrics, "a", "found.json")
    assert found.outside == (1,)


def test_tables_hold_every_method_and_every_digit():
    rows = compare([method("a", [10.0, 30.0]), method("b", [11.0, 31.1])], ("psnr_tissue",))
    table = comparison_table(rows)
    assert "differences to a" in table and "+1.05" in table and "2 of 2 frames" in table
    cells = list(csv.DictReader(io.StringIO(comparison_csv(rows))))
    assert [row["method"] for row in cells] == ["a", "b"] and cells[0]["difference"] == ""
    assert float(cells[1]["difference"]) == rows[1].difference.mean


@pytest.mark.parametrize("label", ["=HYPERLINK(1)", "+1", "-1+1", "@sum", "\t=1", "\n=1", "a\r=1"])
def test_no_text_of_a_csv_is_a_formula_or_ends_its_row(label):
    """Names of methods and frames are chosen by others; a spreadsheet computes a text that begins so."""
    shown = "a\n=1" if "\r" in label else f"'{label}"
    frame = {"frame": 0, "name": label, "time": 0.0, "psnr_full": -1.5}
    text = frames_csv({"held_out": {"per_frame": [frame]}, "baselines": {}}, label)
    (row,) = csv.DictReader(io.StringIO(text, newline=""))
    assert (row["method"], row["name"], row["psnr_full"]) == (shown, shown, "-1.5")


def test_frames_as_csv_read_back_as_the_same_numbers():
    metrics = {
        "held_out": {"per_frame": [{"frame": 1, "name": "a,b", "time": 1 / 3, "psnr_full": 0.1 + 0.2, "lpips": None}]},
        "baselines": {"x": {"label": "X", "per_frame": [{"frame": 1, "name": "a,b", "time": 1 / 3, "psnr_full": 2.0}]}},
    }
    rows = list(csv.DictReader(io.StringIO(frames_csv(metrics, "mine"))))
    assert [row["method"] for row in rows] == ["mine", "X"] and rows[0]["name"] == "a,b"
    assert float(rows[0]["psnr_full"]) == 0.1 + 0.2 and rows[0]["lpips"] == ""
