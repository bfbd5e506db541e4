"""The commands of README.md, word for word, each in a fresh clone with a virtual environment of its own.

    python tests/readme.py                run all of them; the exit code is 1 if one of them fails
    python tests/readme.py --only 2       run the second one
    python tests/readme.py --again 3      run the third one once more in its clone
    python tests/readme.py --cache DIR    keep compiled kernels in DIR/endotsr/kernels

They are the `sh` blocks of the section "Two commands". A command that does not make the environment `.venv` finds an
empty one. The clone is made of the last commit, so it holds no file that git does not know. The first command finds no
compiled kernel, and the later ones those of the commands before. Needs git and Python alone.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
SECTION = re.compile(r"^## Two commands\n(.*?)(?=^## )", flags=re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```sh\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
OURS = (  # a newcomer has none of them
    *("VIRTUAL_ENV", "PYTHONPATH", "PYTHONHOME", "PYTHONDONTWRITEBYTECODE"),
    *("NUMBA_CACHE_DIR", "ENDOTSR_DATA"),
)


class Outcome(NamedTuple):
    """A command, its exit code and its time."""

    command: str
    code: int
    seconds: float


def commands(readme: str) -> list[str]:
    """The `sh` blocks of the section. Raises ValueError if it is missing or holds fewer than two."""
    section = SECTION.search(readme)
    found = BLOCK.findall(section[1]) if section else []
    if len(found) < 2:
        raise ValueError('README.md: no two `sh` blocks in the section "Two commands"')
    return [block.strip() for block in found]


def prepared(folder: Path, command: str) -> Path:
    """A clone of the last commit, with an empty environment unless the command makes it."""
    clone = folder / "endotsr"
    subprocess.run(["git", "clone", "--quiet", "--no-hardlinks", ROOT, clone], check=True)
    if "-m venv .venv" not in command:
        subprocess.run([sys.executable, "-m", "venv", clone / ".venv"], check=True)
    return clone


def run(command: str, clone: Path, cache: Path) -> Outcome:
    """Run one command in its clone, as a shell does, with `cache` as the user's one except for packages of pip."""
    environment = {key: value for key, value in os.environ.items() if key not in OURS}
    of_pip = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    environment |= {"PIP_CACHE_DIR": os.environ.get("PIP_CACHE_DIR") or str(Path(of_pip) / "pip")}
    environment |= {"XDG_CACHE_HOME": str(cache)}
    print(f"$ {command}", flush=True)
    start = time.perf_counter()
    code = subprocess.run(["bash", "-c", command], cwd=clone, env=environment, stdin=subprocess.DEVNULL).returncode
    return Outcome(command, code, time.perf_counter() - start)


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", type=int, nargs="+", metavar="N", help="commands to run, counted from 1")
    parser.add_argument("--again", type=int, nargs="+", default=[], metavar="N", help="commands to run twice")
    parser.add_argument("--cache", type=Path, metavar="DIR", help="folder for the user's cache (default: temporary)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        outcomes = run_all(options.only, options.again, (options.cache or Path(folder)).absolute())
    for command, code, seconds in outcomes:
        print(f"{f'exit code {code}' if code else 'ok':12s} {seconds:6.0f} s  {command}")
    return 1 if any(outcome.code for outcome in outcomes) else 0


def run_all(only: list[int] | None, again: list[int], cache: Path) -> list[Outcome]:
    """Run the commands with these numbers, or all, each in its own clone."""
    outcomes = []
    for number, command in enumerate(commands((ROOT / "README.md").read_text(encoding="utf-8")), start=1):
        if only and number not in only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            clone = prepared(Path(folder), command)
            outcomes += [run(command, clone, cache) for _ in range(2 if number in again else 1)]
    return outcomes


if __name__ == "__main__":
    sys.exit(main())
