"""Windows on two real Dask workers, one of which is killed; skipped without Dask."""

import json
import sys
from pathlib import Path

import pytest
from small_recording import CHAIN, COLD, WARM, write_recording

from endotsr.cli.main import main

sys.path.insert(0, str(Path(__file__).parents[2] / "studies" / "sweeps"))
from dask_cluster import Cluster, in_the_middle
from tiny_sweep import assert_same_arrays, iterations, kill, start, wait_until

pytest.importorskip("distributed", reason="Dask is not installed (pip install 'endotsr[cluster]')")

SMALL = [*CHAIN, "--training.checkpoint-every", "20", "--threads", "1"]


@pytest.mark.faults
@pytest.mark.timeout(1800)
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the run of a worker is found in /proc")
def test_a_killed_worker_loses_nothing_and_windows_equal_those_of_the_local_pool(tmp_path):
    """The worker is killed in the middle of a warm window, which another one continues from its checkpoint."""
    source = write_recording(tmp_path / "recording", frames=104)
    out, local = tmp_path / "cluster", tmp_path / "local"
    cluster = Cluster(tmp_path)
    try:
        first, _ = cluster.worker("first"), cluster.worker("second")
        train = start("train", str(source), "--out", str(out), *SMALL, "--scheduler", cluster.address)
        warm = out / "windows"
        wait_until(lambda: (warm / "001").exists() or (warm / "003").exists() or train.poll() is not None, 900)
        wait_until(lambda: in_the_middle(first.pid, WARM) or train.poll() is not None, 900)
        assert train.poll() is None, train.communicate()
        kill(first)
        said, errors = train.communicate(timeout=900)
    finally:
        cluster.end()
    assert train.returncode == 0, (said, errors)
    starts = [line.split(", ")[1] for line in said.splitlines() if line.startswith("window") and " start, " in line]
    assert starts == ["cold start", "warm start"] * 2

    assert main(["train", str(source), "--out", str(local), *SMALL, "--workers", "2"]) == 0
    records = []
    for name, length in zip(("000", "001", "002", "003"), (COLD, WARM) * 2, strict=True):
        here, there = (folder / "windows" / name for folder in (out, local))
        assert iterations(here) == list(range(1, length + 1)), "each iteration once, none lost"
        assert_same_arrays(here, there)
        records.append(json.loads((here / "run.json").read_text()))
    assert sum(len(record["resumed"]) for record in records) == 1, "the window of the killed worker went on"
