"""Tests of the package on a system like Windows: python tests/foreign.py [TESTS OR OPTIONS OF PYTEST]

The tests run in a process of their own in which the package finds what `foreign_system/sitecustomize.py` lists. Without
words, all tests run that concern files, processes and text; `test_foreign.py` runs a part of them with every suite.
The exit code is that of pytest.
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
ALL = (
    *(
        "tests/cli",
        "tests/faults",
        "tests/port/judge",
        "tests/results/report",
        "tests/clips/formats",
        "tests/clips/opencv",
        "tests/clips/sequences",
        "tests/clips/masks",
        "tests/clips/prepare",
        "tests/clips/simulator",
    ),
    *(
        "tests/studies/sweeps",
        "tests/results/evaluation",
        "tests/results/export",
        "tests/results/views",
        "tests/test_api.py",
    ),
)


def run(*words: str, kept: bool = False) -> subprocess.CompletedProcess[str]:
    """pytest with these words under the foreign system."""
    return python([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words], kept=kept)


def python(command: list[str], *, kept: bool = False) -> subprocess.CompletedProcess[str]:
    """A command under the foreign system; its standard output is kept, or shown."""
    environment = os.environ | {"PYTHONPATH": str(HERE / "foreign_system"), "MPLBACKEND": "Agg"}
    return subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE if kept else None, text=True)


if __name__ == "__main__":
    sys.exit(run(*(sys.argv[1:] or ALL)).returncode)
