"""A long training by repetition and the cost of the guard: python tests/faults/soak.py --iterations 20000

A small simulated scene is trained into a run folder. The resident memory is noted at every hundredth iteration.
After the first quarter, when density control has long ended, the memory must stay within 2 % of its median.

The guard against numbers that are not finite is timed on arrays of as many Gaussians as `--guard` says.
"""

import argparse
import datetime
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "cli"), str(HERE.parent)]

import numpy as np  # noqa: E402

EVERY = 100  # iterations between two looks at the memory
FLAT = 0.02  # of the median


def resident_bytes() -> int:
    """Memory of this process that is in RAM now."""
    import resource

    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def soak(iterations: int, scratch: Path) -> dict[str, Any]:
    """Train; returns memory over iterations, and its largest deviation after the first quarter."""
    from tiny import train_words

    from endotsr.cli.main import main
    from endotsr.cli.parts.progress import Progress

    seen: list[tuple[int, int, int]] = []
    update = Progress.update

    def look(self: Progress, entry: dict[str, Any]) -> None:
        update(self, entry)
        if entry["iteration"] % EVERY == 0:
            seen.append((entry["iteration"], resident_bytes(), entry["gaussians"]))

    Progress.update = look
    settled = min(600, iterations // 4)
    words = train_words(scratch / "run", "--no-evaluate", "--density.until", str(settled))
    words[words.index("--iterations") + 1] = str(iterations)
    words[words.index("--training.checkpoint-every") + 1] = "500"
    words[words.index("--density.interval") + 1] = "50"
    began = time.monotonic()
    try:
        code = main(words)
    finally:
        Progress.update = update
    late = [memory for iteration, memory, _ in seen if iteration > max(2 * settled, iterations // 4)]
    median = statistics.median(late)
    spread = max(abs(memory - median) for memory in late) / median
    return {
        "iterations": iterations,
        "exit_code": code,
        "seconds": round(time.monotonic() - began, 1),
        "median_bytes": int(median),
        "largest_deviation": round(spread, 5),
        "gaussians": seen[-1][2],
        "memory": [[iteration, memory] for iteration, memory, _ in seen],
    }


def guard_seconds(count: int, repeats: int = 200) -> float:
    """Median time of the check of the gradients of `count` Gaussians in float32, seconds."""
    from endotsr.training.fitting.divergence import not_finite

    rng = np.random.default_rng(0)
    shapes = {"d_position": (3,), "d_log_scale": (3,), "d_quaternion": (4,), "d_opacity_logit": ()}
    gradients = {name: rng.normal(size=(*shape, count)).astype(np.float32) for name, shape in shapes.items()}
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        assert not_finite(gradients) is None
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def plot(found: dict[str, Any], path: Path) -> None:
    """Memory over iterations."""
    from matplotlib.figure import Figure

    iterations, memory = np.array(found["memory"]).T
    figure = Figure(figsize=(6, 3), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(iterations, memory / 1e6)
    axes.set(xlabel="iteration", ylabel="resident memory, MB", ylim=(0, 1.2 * memory.max() / 1e6))
    figure.savefig(path, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=20_000)
    parser.add_argument("--guard", type=int, default=65_000, help="Gaussians")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        found = soak(asked.iterations, Path(scratch))
    guard = {"gaussians": asked.guard, "seconds": guard_seconds(asked.guard)}
    print(f"memory {found['median_bytes'] / 1e6:.1f} MB, within {found['largest_deviation']:.2%} of the median")
    print(f"guard of {asked.guard} Gaussians: {1e3 * guard['seconds']:.3f} ms an iteration")
    if asked.json:
        from endotsr.training.runs.machine import machine

        about = {"date": datetime.date.today().isoformat(), "machine": machine(), "guard": guard, "soak": found}
        asked.json.write_text(json.dumps(about, indent=1) + "\n")
    if asked.plot:
        plot(found, asked.plot)
    return 0 if found["exit_code"] == 0 and found["largest_deviation"] <= FLAT else 1


if __name__ == "__main__":
    sys.exit(main())
