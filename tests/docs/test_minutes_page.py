"""docs/bench.md: the table of quality against minutes is what the stored runs say."""

import json
from argparse import Namespace

import pytest
from pages.bench import minutes

from endotsr.errors import InputError


def run(folder, clip, psnr):
    """A finished run of two iterations."""
    folder.mkdir()
    means = {"psnr_full": psnr, "ssim_full": 0.9, "lpips": 0.1}
    about = {"seed": 0, "iteration": 2, "gaussians": 5, "threads": 1, "started": "2026-01-02T03:04:05",
             "machine": {"processor": "P"}, "peak_memory_bytes": 1e9,
             "input": {"source": f"/somewhere/{clip}", "frames": 9, "width": 8, "height": 6}}  # fmt: skip
    levels = {name: {"mean": means} for name in minutes.LEVELS}
    (folder / "metrics.json").write_text(json.dumps({"run": about, "held_out": {"mean": means}, "baselines": levels}))
    (folder / "log.jsonl").write_text('{"iteration": 1, "seconds": 60.0}\n{"iteration": 2, "seconds": 30.0}\n')
    return folder


def test_row_is_the_mean_of_its_runs_and_the_time_that_of_the_iterations(tmp_path):
    record = tmp_path / "minutes.json"
    measured = lambda name, *runs: minutes.measured(Namespace(runs=[*runs], name=name, record=record))
    result = measured("sharp", run(tmp_path / "a", "clip", 30.0), run(tmp_path / "b", "clip", 32.0))
    assert "| `sharp` | 1 | 1.5 | 2 | 5 | 1.0 | 31.00 | 0.9000 | 0.1000 |" in minutes.table(result)
    record.write_text(json.dumps(result))
    assert "/somewhere" not in record.read_text()
    with pytest.raises(InputError, match="use the clip of the other rows"):
        measured("other", run(tmp_path / "c", "other", 30.0))
