"""The evaluation of a whole run: what it keeps, and what the report shows of it."""

import numpy as np
import pytest

from endotsr.evaluation.run import RENDERS_KEPT, Renders
from endotsr.report.run_files import worst_first
from endotsr.splatting.render import RenderOut


def test_renders_are_made_when_asked_for_and_few_are_kept():
    made = []

    def render(index):
        made.append(index)
        return RenderOut(np.full((1, 1, 1), index), np.zeros((1, 1)), np.zeros((1, 1)))

    frames = tuple(range(0, 5 * RENDERS_KEPT, 2))
    renders = Renders(render, frames)
    assert list(renders) == list(frames) and len(renders) == len(frames) and not made
    assert renders[4].colour.item() == renders[4].colour.item() == 4 and made == [4]
    assert 6 in renders and 3 not in renders and made == [4]
    with pytest.raises(KeyError):
        renders[3]
    for i in frames:
        assert renders[i].colour.item() == i
    assert len(made) == len(frames)  # the one that was kept is not made again
    assert all(renders[i].colour.item() == i for i in frames[-RENDERS_KEPT:]) and len(made) == len(frames)
    assert renders[0].colour.item() == 0 and len(made) == len(frames) + 1  # it had been dropped


def test_the_report_shows_the_worst_frames_and_the_folder_has_all(tmp_path, monkeypatch):
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))
    from tiny import train_words

    from endotsr.cli.main import main
    from endotsr.report import run_files
    from endotsr.runs.files import read_json

    monkeypatch.setattr(run_files, "MOST_SHOWN", 1)
    assert main(train_words(tmp_path / "run", "--sequence.split", "every_second")) == 0
    rows = read_json(tmp_path / "run" / "metrics.json")["held_out"]["per_frame"]
    worst, *others = sorted(rows, key=lambda row: row["psnr_tissue"])
    assert others
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert f"The 1 worst of {len(rows)} frames" in page
    assert [row["frame"] for row in rows if f"Render, frame {row['frame']}" in page] == [worst["frame"]]
    assert len(list((tmp_path / "run" / "renders").glob("*_comparison.png"))) == len(rows)


@pytest.mark.parametrize("value", [None, float("nan")])
def test_a_frame_without_a_value_is_the_worst(value):
    rows = {k: {"psnr_tissue": psnr} for k, psnr in enumerate([30.0, value, float("inf"), 20.0])}
    assert worst_first(rows) == [1, 3, 0, 2]
