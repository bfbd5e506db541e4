"""A sweep through a real Dask scheduler and real worker processes; skipped without Dask."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from dask_cluster import Cluster, in_the_middle
from tiny_sweep import (
    assert_same_checkpoints,
    iterations,
    kill,
    numbers,
    rows_of,
    start,
    wait_until,
    write_spec,
)

from endotsr.cli.main import main
from endotsr.studies.sweeps import cluster as sweep_cluster

pytest.importorskip("distributed", reason="Dask is not installed (pip install 'endotsr[cluster]')")

NOWHERE = "tcp://127.0.0.1:9"
LENGTH = 100  # iterations, enough to kill a worker in the middle


@pytest.fixture
def cluster(tmp_path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.end()


def refused(capsys, folder: Path, address: str) -> str:
    """What a sweep with this scheduler says, which ends with exit code 2 and one line."""
    capsys.readouterr()
    words = ["sweep", str(write_spec(folder)), "--out", str(folder / "out"), "--scheduler", address]
    assert main(words) == 2
    said = capsys.readouterr().err.splitlines()
    lines = [line for line in said if line.startswith("endotsr: error: ")]
    assert len(lines) == 1, said
    return lines[0]


@pytest.mark.timeout(1800)
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the run of a worker is found in /proc")
def test_a_killed_worker_loses_nothing_and_results_equal_the_local_pool(cluster, tmp_path):
    first, _ = cluster.worker("first"), cluster.worker("second")
    spec = write_spec(tmp_path, iterations=str(LENGTH))
    out, local = tmp_path / "cluster", tmp_path / "local"
    sweep = start("sweep", str(spec), "--out", str(out), "--scheduler", cluster.address)
    runs = out / "runs"
    # the middle: one run is finished, and the worker is in the middle of another
    wait_until(lambda: len(list(runs.glob("*/metrics.json"))) >= 1 or sweep.poll() is not None, 900)
    wait_until(lambda: in_the_middle(first.pid, LENGTH) or sweep.poll() is not None, 900)
    assert sweep.poll() is None, sweep.communicate()
    finished = {path.parent.name: path.stat().st_mtime_ns for path in runs.glob("*/metrics.json")}
    kill(first)
    said, errors = sweep.communicate(timeout=900)
    assert sweep.returncode == 0, (said, errors)

    rows = rows_of(out)
    assert len(rows) == 4 and {row["status"] for row in rows.values()} == {"finished"}
    for name in rows:
        assert iterations(runs / name) == list(range(1, LENGTH + 1))  # each iteration once, none lost
    records = [json.loads((runs / name / "run.json").read_text()) for name in rows]
    assert sum(len(record["resumed"]) for record in records) == 1  # that of the killed worker went on
    for name, written in finished.items():
        assert (runs / name / "metrics.json").stat().st_mtime_ns == written  # what was finished was left alone

    assert main(["sweep", str(spec), "--out", str(local), "--workers", "1", "--threads", "1"]) == 0
    assert numbers(out) == numbers(local)
    assert_same_checkpoints(out, local)


def test_no_scheduler_is_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_cluster, "PATIENCE", 1.0)
    assert f"{NOWHERE}: no Dask scheduler answers; use " in refused(capsys, tmp_path, NOWHERE)


def test_a_worker_of_another_version_is_one_line(cluster, capsys, tmp_path):
    (tmp_path / "other_version.py").write_text("import endotsr\nendotsr.__version__ = '9.9'\n")
    cluster.worker("other", "--preload", str(tmp_path / "other_version.py"))
    said = refused(capsys, tmp_path, cluster.address)
    assert "endotsr 9.9 (here " in said and "use those of this machine" in said
    assert not list((tmp_path / "out" / "runs").iterdir())


def test_a_worker_that_takes_several_runs_is_one_line(cluster, capsys, tmp_path):
    cluster.worker("wide", "--nthreads", "3")
    assert "has 3 threads; use --nthreads 1" in refused(capsys, tmp_path, cluster.address)


def test_no_scheduler_option_without_dask_is_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "endotsr[cluster]" in refused(capsys, tmp_path, NOWHERE)
