"""The process pool, with processes that are killed."""

import contextlib
import json
import os
import signal
import time
from functools import partial
from pathlib import Path

import pytest
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

from endotsr.studies.sweeps.local import LOOK

pytestmark = [
    pytest.mark.skipif(not Path("/proc/self").exists(), reason="processes are found in /proc"),
    pytest.mark.timeout(1800),
]
LENGTH = 60  # iterations, enough to kill a process in the middle


def children(pid: int) -> list[int]:
    """Processes whose parent this is and that were spawned as workers."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
            parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue
        if parent == pid and any(b"spawn_main" in word for word in words):
            found.append(int(folder.name))
    return found


def state(pid: int) -> str:
    """The state of a process: `T` is suspended, `Z` an entry that its parent has not read, also of one that is gone."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    return "Z"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The sweep from beginning to end."""
    folder = tmp_path_factory.mktemp("undisturbed")
    process = start("sweep", str(write_spec(folder, iterations=str(LENGTH))), "--out", str(folder / "out"))
    said, errors = process.communicate(timeout=500)
    assert process.returncode == 0, (said, errors)
    return folder / "out"


def middle(out: Path) -> bool:
    """Whether a run has a checkpoint and is far from its end."""
    logs = [path for path in out.glob("runs/*/log.jsonl") if (path.parent / "checkpoint.npz").exists()]
    return any(7 < len(path.read_text().splitlines()) < LENGTH * 2 // 3 for path in logs)


def suspended(pid: int) -> bool:
    return state(pid) == "T"


def hold_worker_in_the_middle(parent: int, out: Path) -> int:
    """The only worker, suspended while its run is in the middle."""
    while True:
        wait_until(lambda: middle(out))
        (worker,) = children(parent)
        os.kill(worker, signal.SIGSTOP)
        wait_until(partial(suspended, worker))
        if middle(out):  # the iterations between the look and the signal are few, and sometimes too many
            return worker
        os.kill(worker, signal.SIGCONT)


def assert_whole(out: Path, undisturbed: Path) -> None:
    """Every iteration of every run once, and the results of the undisturbed sweep."""
    assert {row["status"] for row in rows_of(out).values()} == {"finished"}
    for run in (out / "runs").iterdir():
        assert iterations(run) == list(range(1, LENGTH + 1))
    assert numbers(out) == numbers(undisturbed)
    assert_same_checkpoints(out, undisturbed)


@pytest.mark.slow
def test_a_killed_sweep_continues_run_by_run(undisturbed, tmp_path):
    words = ("sweep", str(write_spec(tmp_path, iterations=str(LENGTH))), "--out", str(tmp_path / "out"))
    first = start(*words)
    wait_until(lambda: middle(tmp_path / "out") or first.poll() is not None)
    workers = children(first.pid)
    kill(first)
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 60)  # they end with their parent
    second = start(*words)
    said, errors = second.communicate(timeout=500)
    assert second.returncode == 0, (said, errors)
    assert_whole(tmp_path / "out", undisturbed)


@pytest.mark.slow
def test_a_killed_worker_loses_no_run(undisturbed, tmp_path):
    out = tmp_path / "out"
    process = start("sweep", str(write_spec(tmp_path, iterations=str(LENGTH))), "--out", str(out))
    wait_until(lambda: middle(out) or process.poll() is not None)
    os.kill(children(process.pid)[0], signal.SIGKILL)
    said, errors = process.communicate(timeout=500)
    assert process.returncode == 0, (said, errors)
    assert_whole(out, undisturbed)


@pytest.mark.slow
def test_workers_end_with_a_checkpoint_when_the_file_appears_and_no_signal_is_sent(undisturbed, tmp_path):
    out = tmp_path / "out"
    words = ("sweep", str(write_spec(tmp_path, iterations=str(LENGTH))), "--out", str(out), "--workers", "1")
    process = start(*words)
    worker = hold_worker_in_the_middle(process.pid, out)
    os.kill(process.pid, signal.SIGSTOP)  # the parent does nothing
    (out / "sweep.stop").touch()
    time.sleep(2 * LOOK)  # its next look for the file is due: a fast machine ends a run between two of them
    os.kill(worker, signal.SIGCONT)
    wait_until(lambda: not any(state(pid) != "Z" for pid in children(process.pid)), 60)
    (run,) = (
        run for run in (out / "runs").iterdir() if json.loads((run / "run.json").read_text())["status"] != "finished"
    )
    assert json.loads((run / "run.json").read_text())["iterations_done"] == len(iterations(run))  # none is lost
    kill(process)
    again = start(*words)
    assert again.wait(timeout=500) == 0 and not (out / "sweep.stop").exists()
    assert_whole(out, undisturbed)


@pytest.mark.slow
def test_a_signal_writes_checkpoints_and_says_how_to_continue(undisturbed, tmp_path):
    out = tmp_path / "out"
    words = ("sweep", str(write_spec(tmp_path, iterations=str(LENGTH))), "--out", str(out), "--workers", "1")
    process = start(*words)
    wait_until(lambda: middle(out) or process.poll() is not None)
    process.terminate()
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "of 4 runs are finished; the same command continues" in errors.splitlines()[-1]
    again = start(*words)
    assert again.wait(timeout=500) == 0
    assert_whole(out, undisturbed)
