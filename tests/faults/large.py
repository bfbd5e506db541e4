"""A million Gaussians, and more threads than cores: python tests/faults/large.py --json docs/results/large.json

A simulated clip of 1280x1024 pixels is trained from a million points, in a process whose peak memory the system states.
A tiny training with sixteen threads is compared with one of one thread, bit by bit, and timed.
"""

import argparse
import datetime
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "cli"), str(HERE.parent)]

from tiny import assert_same_run, train_words  # noqa: E402

FRAMES = 9


def trained(words: list[str], **environment: str) -> dict[str, float]:
    """A training in a process of its own: seconds, and the most bytes in RAM. Raises SystemExit if it fails."""
    began = time.monotonic()
    process = subprocess.Popen([sys.executable, "-m", "endotsr", *words], env=os.environ | environment)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"failed: endotsr {' '.join(words)}")
    unit = 1 if sys.platform == "darwin" else 1024
    return {
        "seconds": round(time.monotonic() - began, 1),
        "peak_bytes": usage.ru_maxrss * unit,
    }


def many_gaussians(count: int, iterations: int, width: int, height: int, scratch: Path) -> dict[str, Any]:
    """Train from `count` pixels of the first frame."""
    scene = scratch / "scene"
    size = ["--width", str(width), "--height", str(height), "--frames", str(FRAMES)]
    trained(["simulate", "pulling", "--out", str(scene), *size])
    words = [
        "train", str(scene), "--out", str(scratch / "many"), "--no-evaluate",
        "--iterations", str(iterations), "--training.checkpoint-every", str(iterations),
        "--initialisation.first-frame-points", str(count),
        "--initialisation.other-frame-points", "0", "--density.until", "0",
    ]  # fmt: skip
    found = trained(words)
    log = [json.loads(line) for line in (scratch / "many" / "log.jsonl").read_text(encoding="utf-8").splitlines()]
    about = {"width": width, "height": height, "iterations": iterations, "gaussians": log[-1]["gaussians"]}
    late = statistics.median(entry["seconds"] for entry in log[len(log) // 2 :])
    checkpoint = (scratch / "many" / "checkpoint.npz").stat().st_size
    return found | about | {"iteration_seconds": round(late, 3), "checkpoint_bytes": checkpoint}


def many_threads(threads: int, scratch: Path) -> dict[str, Any]:
    """A tiny training with one thread and with `threads`, which must not differ in a bit."""
    seconds = {}
    for count in (1, threads):
        words = train_words(scratch / str(count), "--no-evaluate")
        words[words.index("--training.threads") + 1] = str(count)
        seconds[count] = trained(words, NUMBA_NUM_THREADS=str(threads))["seconds"]
    assert_same_run(scratch / "1", scratch / str(threads))
    return {"threads": threads, "cores": os.cpu_count(), "seconds_of_one": seconds[1], "seconds": seconds[threads]}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gaussians", type=int, default=1_000_000)
    parser.add_argument("--iterations", type=int, default=20)
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=1024)
    parser.add_argument("--threads", type=int, default=16)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        many = many_gaussians(asked.gaussians, asked.iterations, asked.width, asked.height, scratch)
        threads = many_threads(asked.threads, scratch)
    print(
        f"{many['gaussians']} Gaussians: {many['iteration_seconds']} s an iteration, {many['peak_bytes'] / 1e9:.2f} GB"
    )
    print(f"{threads['threads']} threads on {threads['cores']} cores: bitwise equal, {threads['seconds']} s")
    if asked.json:
        from endotsr.training.runs.machine import machine

        about = {"date": datetime.date.today().isoformat(), "machine": machine(), "many": many, "threads": threads}
        asked.json.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
