"""Runs small enough for tests: a 48x32 simulated sequence, a few hundred Gaussians, 30 iterations."""

import atexit
import functools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from endonerf_writer import write_endonerf
from endotsr.cli.main import main
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.scenes import IN_FILES, effects_on
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate

SETTINGS = [
    *("--iterations", "30"),
    *("--initialisation.first-frame-points", "150"),
    *("--initialisation.other-frame-points", "40"),
    *("--density.interval", "5"),
    *("--training.checkpoint-every", "7"),
    *("--training.threads", "1"),
]


def train_words(out: Path, *more: str, source: str | None = None) -> list[str]:
    """`train SOURCE --out OUT` with tiny settings, on `scene()` if no other source is named."""
    return ["train", scene() if source is None else source, "--out", str(out), *SETTINGS, *more]


@functools.cache
def scene(*off: str, frames: int = 9, seed: int = 0) -> str:
    """A folder with a simulated sequence of 48x32 and its truth, written once a process; `off` names effects."""
    folder = tempfile.mkdtemp(prefix="endotsr-scene-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    settings = SimulatorSettings(width=48, height=32, frames=frames, seed=seed)
    on = (name for name in effects_on(settings) if name not in off)
    write_sequence(Path(folder) / "scene", with_effects(settings, *on, *IN_FILES))
    return str(Path(folder) / "scene")


def run_line(capsys, *words: str) -> tuple[int, str]:
    """Exit code and what was said on standard error."""
    capsys.readouterr()
    code = main(list(words))
    return code, capsys.readouterr().err


def assert_refused(capsys, words: list[str], *named: str) -> None:
    """The command fails with exit code 2 and one line that holds every word of `named`."""
    code, said = run_line(capsys, *words)
    assert code == 2, said
    assert said.startswith("endotsr: error: ") and said.count("\n") == 1, said
    for word in named:
        assert word in said, f"{word!r} not in {said!r}"


def render(run: Path, out: Path, *words: str) -> dict:
    """The pictures of a run, and what render.json says of them."""
    assert main(["render", str(run), "--out", str(out), *words]) == 0
    return json.loads((out / "render.json").read_text())


def written_folder(root: Path) -> Path:
    """A tiny EndoNeRF folder with 9 frames of 48x32."""
    folder = root / "sequence"
    write_endonerf(simulate(SimulatorSettings(width=48, height=32, frames=9)).sequence, folder)
    return folder


def start(words: list[str], cwd: Path) -> subprocess.Popen:
    """The command in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "endotsr.cli.main", *words],
        cwd=cwd,
        env=os.environ | {"MPLBACKEND": "Agg"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def log_without_seconds(run: Path) -> list[dict]:
    """The log, times left out."""
    entries = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    return [{key: value for key, value in entry.items() if key != "seconds"} for entry in entries]


def assert_same_run(a: Path, b: Path) -> None:
    """Bitwise equal checkpoints (the header, which holds the settings, apart), and equal logs but for the seconds."""
    assert log_without_seconds(a) == log_without_seconds(b)
    with np.load(a / "checkpoint.npz") as first, np.load(b / "checkpoint.npz") as second:
        assert first.files == second.files
        for key in set(first.files) - {"header"}:
            assert first[key].tobytes() == second[key].tobytes(), key
        headers = [json.loads(file["header"].tobytes()) for file in (first, second)]
    for header in headers:
        for name in ("threads", "checkpoint_every"):  # they change no result
            header["header"]["config"]["training"].pop(name)
    assert headers[0] == headers[1]
