"""A short list of tests with the lowest or the newest versions of every dependency, in an environment of its own.

    python tests/versions.py lowest                                lowest versions that pyproject.toml allows
    python tests/versions.py newest                                newest ones
    python tests/versions.py opencv4                               newest ones, but OpenCV 4
    python tests/versions.py lowest --python python3.11 --folder /tmp/lowest tests/clips/sequences    what, where

`lowest` takes the last correction of the lowest minor version (`numpy>=2.1` becomes `numpy==2.1.*`). The tests of the
default list read every kind of file, decode and write films, match stereo pairs, draw figures, and train: they touch
every dependency. The exit code is that of pytest.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
BOUND = re.compile(r"([A-Za-z0-9_.-]+)>=([0-9.]+)")
TESTS = (
    "tests/clips/opencv/test_opencv.py",
    "tests/clips/prepare/test_prepare.py",
    "tests/clips/prepare/test_stereo_depth.py",
    "tests/clips/masks/test_propose_masks.py",
    "tests/cli/test_cli_any_clip.py",
    "tests/method/kernels/test_vectors.py",
    "tests/method/kernels/test_exponential.py",
    "tests/training/fitting/test_adam.py",
    "tests/results/report/test_figures.py",
    "tests/results/views/test_film.py",
)
OPENCV = "opencv-contrib-python-headless"


def dependencies() -> list[str]:
    """What the package needs, as pyproject.toml states it."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]


def constraints(which: str) -> list[str]:
    """The lines of a constraints file. Raises ValueError for a dependency without a lower bound."""
    if which == "newest":
        return []
    if which == "opencv4":
        return [f"{OPENCV}<5"]
    found = []
    for text in dependencies():
        bound = BOUND.match(text)
        if bound is None:
            raise ValueError(f"pyproject.toml: {text!r} has no lower bound; use name>=version")
        found.append(f"{bound[1]}=={bound[2]}.*")
    return found


def build(folder: Path, python: str, which: str) -> Path:
    """An environment with the package, its tests and these versions; returns its interpreter."""
    subprocess.run([python, "-m", "venv", folder], check=True)
    inside = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    pins = folder / "constraints.txt"
    pins.write_text("\n".join(constraints(which)) + "\n", encoding="utf-8")
    install = [inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", pins, ".[test]"]
    subprocess.run(install, check=True, cwd=ROOT)
    return inside


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", choices=("lowest", "newest", "opencv4"))
    parser.add_argument("tests", nargs="*", default=TESTS)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        inside = build(options.folder or Path(temporary) / "environment", options.python, options.which)
        names = [BOUND.match(text)[1] for text in dependencies()]  # pyright: ignore[reportOptionalSubscript]
        subprocess.run([inside, "-m", "pip", "list", "--format=freeze", "--disable-pip-version-check"], check=True)
        print("tested with the versions above of", ", ".join(names), flush=True)
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        command = [inside, "-m", "pytest", "-q", *options.tests]
        return subprocess.run(command, cwd=ROOT, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
