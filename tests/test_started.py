"""Every program below tests/ that a docstring or a page names can be started by itself."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STARTED = re.compile(r"python (tests/[\w/]+\.py)")


def named() -> list[str]:
    """The programs that pages and docstrings name."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("tests/**/*.py")]
    return sorted({name for page in pages for name in STARTED.findall(page.read_text(encoding="utf-8"))})


@pytest.mark.parametrize("name", named())
def test_a_program_that_is_named_imports_what_it_needs(name):
    """In a process of its own, without the paths that pytest adds."""
    code = f"import runpy; runpy.run_path({str(ROOT / name)!r}, run_name='imported')"
    with_package = {"PYTHONPATH": str(ROOT / "reference")}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[0] = {str((ROOT / name).parent)!r}; {code}"],
        capture_output=True, text=True, cwd=ROOT, env=os.environ | with_package,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.splitlines()[-1]
