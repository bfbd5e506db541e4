"""Ctrl-C in the middle of a recording, and the end of it later."""

import signal
import sys
from pathlib import Path

import pytest
from small_recording import CHAIN, WARM, write_recording

from endotsr.cli.main import main
from endotsr.training.runs.log import last_iteration

sys.path.insert(0, str(Path(__file__).parents[2] / "studies" / "sweeps"))
from tiny_sweep import assert_same_arrays, iterations, start, wait_until

SMALL = [*CHAIN, "--threads", "1", "--workers", "1"]


@pytest.mark.faults
@pytest.mark.timeout(900)
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="a signal stops a process gently on POSIX alone")
def test_ctrl_c_keeps_what_is_trained_and_resume_ends_with_the_same_bits(tmp_path):
    """The second window, which starts from the first, is stopped in its middle."""
    source, out, whole = write_recording(tmp_path / "recording"), tmp_path / "stopped", tmp_path / "whole"
    train = start("train", str(source), "--out", str(out), *SMALL)
    log = out / "windows" / "001" / "log.jsonl"
    wait_until(lambda: WARM // 5 < last_iteration(log) or train.poll() is not None, 600)
    assert train.poll() is None, train.communicate()
    train.send_signal(signal.SIGINT)
    said, errors = train.communicate(timeout=120)
    assert train.returncode == 130, (said, errors)
    assert "1 of 2 windows are finished; continue with" in errors and f"--out {out} --resume" in errors
    stopped = last_iteration(log)
    assert WARM // 5 < stopped < WARM
    finished = (out / "windows" / "000" / "checkpoint.npz").stat().st_mtime_ns

    assert main(["train", "--out", str(out), "--resume", "--no-evaluate", "--workers", "1", "--threads", "1"]) == 0
    assert main(["train", str(source), "--out", str(whole), *SMALL]) == 0
    assert (out / "windows" / "000" / "checkpoint.npz").stat().st_mtime_ns == finished
    assert iterations(out / "windows" / "001") == list(range(1, WARM + 1)), "each iteration once"
    for name in ("000", "001"):
        assert_same_arrays(out / "windows" / name, whole / "windows" / name)
