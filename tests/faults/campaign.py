"""Faults injected into a training, and what became of it: python tests/faults/campaign.py --kills 50 --json FILE

A tiny training (48x32 pixels, 30 iterations, a checkpoint every 7) is run in child processes that are killed, or whose
file operations fail. Afterwards `--resume` runs to the end, and checkpoint and log are compared with those of a
training without a fault, bit by bit. The children are forks of this process, so that no kernel is compiled twice.
"""

import argparse
import datetime
import io
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "cli"), str(HERE.parent)]

from file_layer import disk_full, killed, operations, read_only  # noqa: E402
from tiny import assert_same_run, train_words, written_folder  # noqa: E402

from endotsr.cli.main import main as endotsr  # noqa: E402
from endotsr.training.runs.machine import machine  # noqa: E402


class Bench:
    """A scratch folder with the training that every other one is compared with."""

    def __init__(self, scratch: Path, seed: int) -> None:
        self.scratch, self.random = scratch, random.Random(seed)
        self.reference = scratch / "reference"
        self.said = scratch.with_name("said.txt")  # outside of what the file layer watches
        scratch.mkdir()
        endotsr_quietly(train_words(scratch / "warm", "--no-evaluate"))
        began = time.monotonic()
        assert in_child(lambda: endotsr_quietly(train_words(self.reference, "--no-evaluate"))) == 0
        self.seconds = time.monotonic() - began

    def fresh(self) -> Path:
        """The path of a run that does not exist."""
        out = self.scratch / "run"
        shutil.rmtree(out, ignore_errors=True)
        for leftover in self.scratch.glob(".partial-*"):
            shutil.rmtree(leftover)
        return out

    def finish(self, out: Path) -> bool:
        """Continue the run, or start it where there is none; whether it equals the reference, bit by bit."""
        if out.exists() and not (out / "run.json").exists():  # what could not be removed from a read-only disk
            shutil.rmtree(out)
        words = [*resume(out)] if out.exists() else train_words(out, "--no-evaluate")
        code = in_child(lambda: endotsr_quietly(words))
        try:
            assert code == 0
            assert_same_run(self.reference, out)
            assert not [p for p in out.iterdir() if p.name.startswith(".")]
        except AssertionError:
            return False
        return True


def resume(out: Path) -> list[str]:
    """The command that continues a run."""
    return ["train", "--out", str(out), "--resume", "--no-evaluate"]


def endotsr_quietly(words: list[str], said: Path | None = None) -> int:
    """The command; standard output and standard error go to a file or nowhere."""
    place = os.open(said or os.devnull, os.O_WRONLY | (os.O_CREAT | os.O_TRUNC if said else 0))
    kept = os.dup(1), os.dup(2)
    text = io.TextIOWrapper(io.FileIO(place, "w", closefd=False), "utf-8", write_through=True)
    try:
        sys.stdout.flush()
        os.dup2(place, 1)
        os.dup2(place, 2)
        with redirect_stdout(text), redirect_stderr(text):  # pytest's own streams do not write to 1 and 2
            return endotsr(words)
    finally:
        text.close()
        for number, descriptor in zip((1, 2), kept, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(place)


def start_child(work: Callable[[], int]) -> int:
    """A fork that does the work; returns its process number."""
    child = os.fork()
    if child:
        return child
    code = 99  # an exception that the command did not turn into an exit code
    try:
        code = work()
    finally:
        os._exit(code)


def in_child(work: Callable[[], int]) -> int:
    """Exit code of the work in a fork; a negative number is that of a signal."""
    return os.waitstatus_to_exitcode(os.waitpid(start_child(work), 0)[1])


def kill_at_a_moment(bench: Bench, by_time: bool = False) -> tuple[bool, str]:
    """SIGKILL from outside after a random time; `by_time`: the time for a checkpoint comes at every iteration."""
    out = bench.fresh()

    def work() -> int:
        from endotsr.training.runs import training

        if by_time:
            training.seconds_between = lambda *_: 0.0
        return endotsr_quietly(train_words(out, "--no-evaluate"))

    child = start_child(work)
    time.sleep(bench.random.uniform(0.0, 1.1 * bench.seconds))
    os.kill(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return bench.finish(out) and code in (0, -signal.SIGKILL), "resumed, bitwise equal"


def count_operations(bench: Bench) -> int:
    """File operations of a whole training."""
    out = bench.fresh()
    with operations(bench.scratch) as layer:
        endotsr_quietly(train_words(out, "--no-evaluate"))
    return layer.count


def kill_at_an_operation(bench: Bench, total: int, at: int | None = None) -> tuple[bool, str]:
    """SIGKILL at a random write, rename or flush, mostly inside a checkpoint; then again while it is resumed."""
    out = bench.fresh()
    for words in (train_words(out, "--no-evaluate"), resume(out)):
        moment = at or bench.random.randrange(1, total + 1)
        if words[1] == "--out" and not out.exists():
            break

        def work(words: list[str] = words, moment: int = moment) -> int:
            with operations(bench.scratch, moment, killed):
                return endotsr_quietly(words)

        code = in_child(work)
        if code not in (0, -signal.SIGKILL):
            return False, f"exit code {code}"
    return bench.finish(out), "resumed, bitwise equal"


def fail_at_an_operation(
    bench: Bench, at: int, act: Callable[[object], None], *, onwards: bool = False
) -> tuple[bool, str]:
    """One operation fails (or all from one on): one line, exit code 2, and the run continues afterwards."""
    out, said = bench.fresh(), bench.said

    def work() -> int:
        with operations(bench.scratch, at, act, onwards=onwards):
            return endotsr_quietly(train_words(out, "--no-evaluate"), said)

    code = in_child(work)
    text = said.read_text()
    errors = [line for line in text.splitlines() if line.startswith("endotsr: error: ")]
    clean = "Traceback" not in text and (code == 0 or (code == 2 and len(errors) == 1))
    return clean and bench.finish(out), "one line and exit code 2; resumed, bitwise equal"


def two_processes(bench: Bench) -> tuple[bool, str]:
    """Two resumes of one run at the same time."""
    out = bench.fresh()
    shutil.copytree(bench.reference, out)
    for name in ("checkpoint.npz", "checkpoint.previous.npz"):
        (out / name).unlink()
    children = [start_child(lambda: endotsr_quietly(resume(out))) for _ in range(2)]
    codes = sorted(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children)
    return codes in ([0, 2], [0, 0]) and bench.finish(out), "the second is refused; the first is bitwise equal"


def clock_jumps(bench: Bench) -> tuple[bool, str]:
    """The clock of the day goes back a year at every look, then ahead ten."""
    out = bench.fresh()

    def work() -> int:
        from endotsr.training.runs import records, training

        jumps = iter(range(10**6))
        times = lambda: f"{2026 + (10 if next(jumps) % 2 else -1)}-01-01T00:00:00+00:00"
        records.now = training.now = times
        time.time = lambda: 0.0
        return endotsr_quietly(train_words(out, "--no-evaluate"))

    return in_child(work) == 0 and bench.finish(out), "no effect: durations use a clock that cannot be set"


def sequence_changes(bench: Bench) -> tuple[bool, str]:
    """A picture of the sequence is replaced while the run trains, and the run is then resumed."""
    from endotsr.clips.opencv.png import read_png, write_png

    out, said = bench.fresh(), bench.said
    shutil.rmtree(bench.scratch / "sequence", ignore_errors=True)
    folder = written_folder(bench.scratch)
    words = train_words(out, "--no-evaluate", source=str(folder))

    def work() -> int:
        from endotsr.cli.parts.progress import Progress

        update = Progress.update

        def change(self: Progress, entry: dict[str, Any]) -> None:
            if entry["iteration"] == 10:
                picture = folder / "images" / "000003.png"
                write_png(picture, 255 - read_png(picture))
                os.kill(os.getpid(), signal.SIGKILL)
            update(self, entry)

        Progress.update = change
        return endotsr_quietly(words)

    first = in_child(work)
    second = in_child(lambda: endotsr_quietly(resume(out), said))
    refused = second == 2 and "images differ from those the run" in said.read_text()
    return first == -signal.SIGKILL and refused, "refused: the pictures differ from those of the run"


def folder_vanishes(bench: Bench) -> tuple[bool, str]:
    """The run folder is removed in the middle of the training."""
    out, said = bench.fresh(), bench.said

    def work() -> int:
        from endotsr.cli.parts.progress import Progress

        update = Progress.update

        def vanish(self: Progress, entry: dict[str, Any]) -> None:
            if entry["iteration"] == 10:
                shutil.rmtree(out)
            update(self, entry)

        Progress.update = vanish
        return endotsr_quietly(train_words(out, "--no-evaluate"), said)

    code, text = in_child(work), said.read_text()
    told = "the run folder was deleted" in text and "Traceback" not in text
    return code == 2 and told and bench.finish(out), "one line and exit code 2; a new training is bitwise equal"


def campaign(
    bench: Bench, kills: int, failures: int, store: Callable[[list[dict[str, Any]]], object]
) -> list[dict[str, Any]]:
    """Every fault, as rows of the report, which `store` gets as they grow."""
    total = count_operations(bench)
    spread = sorted({max(1, round(k * total / failures)) for k in range(1, failures + 1)}) if failures else []
    trials: dict[str, list[Callable[[], tuple[bool, str]]]] = {
        "SIGKILL at a random moment": [lambda: kill_at_a_moment(bench)] * (kills // 4),
        "SIGKILL at a random moment, a checkpoint at every iteration": [lambda: kill_at_a_moment(bench, True)]
        * (kills // 2 - kills // 4),
        "SIGKILL inside a file operation, twice in a row": [lambda: kill_at_an_operation(bench, total)]
        * (kills - kills // 2),
        "disk full at one file operation": [lambda at=at: fail_at_an_operation(bench, at, disk_full) for at in spread],
        "disk full from one operation on": [
            lambda at=at: fail_at_an_operation(bench, at, disk_full, onwards=True) for at in spread[::4]
        ],
        "folder becomes read-only": [
            lambda at=at: fail_at_an_operation(bench, at, read_only, onwards=True) for at in spread[1::4]
        ],
        "two processes on one folder": [lambda: two_processes(bench)],
        "the clock jumps": [lambda: clock_jumps(bench)],
        "the sequence changes under the run": [lambda: sequence_changes(bench)],
        "the run folder vanishes": [lambda: folder_vanishes(bench)],
    }
    rows = []
    for name, calls in trials.items():
        found = [call() for call in calls]
        good = sum(passed for passed, _ in found)
        row = {"fault": name, "trials": len(found), "as_promised": good, "what": found[0][1] if found else ""}
        rows.append(row)
        store(rows)
        print(f"{name}: {good} of {len(found)}", flush=True)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--failures", type=int, default=40, help="file operations that fail, spread over a training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        bench = Bench(Path(scratch) / "watched", asked.seed)

        def store(rows: list[dict[str, Any]]) -> None:  # after every row, so that a stopped campaign is not lost
            if asked.json:
                day, seconds = datetime.date.today().isoformat(), round(time.monotonic() - began)
                about = {"date": day, "seed": asked.seed, "seconds": seconds, "machine": machine(), "faults": rows}
                asked.json.write_text(json.dumps(about, indent=1) + "\n")

        rows = campaign(bench, asked.kills, asked.failures, store)
    return 0 if all(row["trials"] == row["as_promised"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
