"""The evaluation of a whole run: what it keeps, and what the report shows of it."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_sequence import made_up

from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation import run
from endotsr.results.report import run_files
from endotsr.results.report.run_files import worst_first


@pytest.mark.parametrize("kept, times", [(32, 1), (2, 2)])
def test_a_held_out_frame_is_rendered_once_where_few_are_held_out(monkeypatch, kept, times):
    """With fewer kept than held out, the oldest is rendered again, and no more of them are in memory."""
    clip = made_up(np.full((9, 3, 40, 40), 100, np.uint8), [1, 4, 7])
    sequence = SimpleNamespace(**vars(clip), cameras=[None] * 9)
    made: Counter[float] = Counter()

    def render_at(gaussians, spectral, config, camera, time, *, frames):
        made[time] += 1
        return RenderOut(np.full((3, 40, 40), time, np.float32), np.ones((40, 40)), np.ones((40, 40)))

    monkeypatch.setattr(run, "render_at", render_at)
    monkeypatch.setattr(run, "RENDERS_KEPT", kept)
    monkeypatch.setattr(run, "without", lambda gaussians, **taken_out: gaussians)
    gaussians = SimpleNamespace(appearance_coefficients=None, motion_coefficients=None)
    model = SimpleNamespace(gaussians=gaussians, spectral=None, config=None, frames=None)
    _, held_out = run.measure_model(model, sequence)
    assert {i: float(held_out(i).colour.max()) for i in (1, 4, 7)} == {
        i: np.float32(sequence.times[i]) for i in (1, 4, 7)
    }
    assert [made[float(sequence.times[i])] for i in (1, 4, 7)] == [times] * 3


def test_the_report_shows_the_worst_frames_and_the_folder_has_all(tmp_path, monkeypatch):
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).parents[2] / "cli"))
    from tiny import train_words

    from endotsr.cli.main import main
    from endotsr.training.runs.files import read_json

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


def test_a_frame_without_tissue_is_not_among_the_worst_where_others_are_left(monkeypatch):
    masks = np.ones((9, 8, 8), bool)
    masks[4] = False
    clip = made_up(np.zeros((9, 3, 8, 8), np.uint8), [1, 4, 7], masks)
    frame = lambda i: SimpleNamespace(image=clip.images[i] / np.float32(255))
    rows = [{"frame": i, "psnr_tissue": value} for i, value in ((1, 30.0), (4, None), (7, 20.0))]
    render = RenderOut(np.zeros((3, 8, 8), np.float32), np.ones((8, 8)), np.ones((8, 8)))
    monkeypatch.setattr(run_files, "MOST_SHOWN", 2)
    shown = run_files.worst_frames(SimpleNamespace(**vars(clip), frame=frame), rows, lambda i: render)
    assert [picture.index for picture in shown] == [1, 7]
