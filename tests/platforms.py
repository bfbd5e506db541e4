"""Resolve the dependencies for every system that a user may have: python tests/platforms.py [--json FILE]

uv (`pip install uv`) chooses wheels for each system and version of Python, without installing anything. It needs the
network and is run by hand before a release:

    python tests/platforms.py --json docs/results/platforms.json && python docs/make.py book.systems

A combination is `complete` where every dependency has a wheel of a final version, so that a user needs no compiler. The
exit code is 1 if a combination is not as SYSTEMS says.
"""

import argparse
import json
import os
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from packaging.version import Version

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SHOWN = ("numpy", "numba", "llvmlite", "scipy", "opencv-contrib-python-headless", "av")
NO_OPENCV = dict.fromkeys(PYTHONS, "opencv-contrib-python-headless")
NO_AV = dict.fromkeys(PYTHONS, "av")
NO_NUMBA = {"3.14": "numba"}


class System(NamedTuple):
    """A kind of machine."""

    name: str
    target: str  # as uv names it
    lacks: dict[str, str]  # version of Python -> the dependency that is known to have no wheel
    macos: str = ""  # its version


SYSTEMS = (
    System("Windows x86-64", "x86_64-pc-windows-msvc", {}),
    System("Windows ARM64", "aarch64-pc-windows-msvc", NO_OPENCV | {"3.11": "numba"}),
    System("macOS 15 Apple silicon", "aarch64-apple-darwin", {}, "15.0"),
    System("macOS 14 Apple silicon", "aarch64-apple-darwin", {}, "14.0"),
    System("macOS 13 Apple silicon", "aarch64-apple-darwin", NO_AV, "13.0"),
    System("macOS 12 Apple silicon", "aarch64-apple-darwin", NO_OPENCV, "12.0"),
    System("macOS 15 Intel", "x86_64-apple-darwin", NO_NUMBA, "15.0"),
    System("macOS 14 Intel", "x86_64-apple-darwin", NO_NUMBA, "14.0"),
    System("macOS 13 Intel", "x86_64-apple-darwin", NO_NUMBA, "13.0"),
    System("Linux x86-64", "x86_64-manylinux_2_28", {}),
    System("Linux aarch64", "aarch64-manylinux_2_28", {}),
)


def dependencies() -> list[str]:
    """What the package needs, as pyproject.toml states it."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]


def resolved(system: System, python: str) -> dict[str, Any]:
    """What would be installed: versions by name, or the dependency that has no wheel."""
    words = ["pip", "compile", "--no-config", "--quiet", "--no-header", "--no-annotate", "--only-binary", ":all:"]
    words += ["--python-version", python, "--python-platform", system.target, "-"]
    done = subprocess.run(
        [sys.executable, "-m", "uv", *words],
        input="\n".join(dependencies()),
        env=os.environ | ({"MACOSX_DEPLOYMENT_TARGET": system.macos} if system.macos else {}),
        capture_output=True, text=True,
    )  # fmt: skip
    found = {"system": system.name, "python": python}
    if done.returncode:
        names = [name for name in SHOWN if f"`{name}`" in done.stderr or f"{name}>" in done.stderr]
        return found | {"complete": False, "lacks": names[0] if names else done.stderr[:300]}
    pairs = (line.split("==") for line in done.stdout.splitlines() if "==" in line)
    versions = {name: version.split(";")[0].strip() for name, version in pairs}
    early = [name for name, version in versions.items() if Version(version).is_prerelease]
    about = {"complete": False, "lacks": early[0]} if early else {"complete": True}
    return found | about | {"versions": {name: versions[name] for name in SHOWN}}


def surprises(rows: list[dict[str, Any]]) -> list[str]:
    """Combinations that are not as SYSTEMS says, in words."""
    known = {(system.name, python): name for system in SYSTEMS for python, name in system.lacks.items()}
    return [
        f"{row['system']}, Python {row['python']}: {row.get('lacks', 'nothing')} has no wheel"
        for row in rows
        if row.get("lacks") != known.get((row["system"], row["python"]))
    ]


def main(words: list[str]) -> int:
    """The command."""
    from endotsr.training.runs.machine import now

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(words)
    subprocess.run([sys.executable, "-m", "uv", "--version"], check=True)
    with ThreadPoolExecutor(4) as pool:
        rows = list(pool.map(lambda pair: resolved(*pair), [(s, p) for s in SYSTEMS for p in PYTHONS]))
    for row in rows:
        said = ", ".join(f"{name} {version}" for name, version in row.get("versions", {}).items())
        print(f"{row['system']:24} {row['python']:5} {said if row['complete'] else 'no wheel: ' + row['lacks']}")
    if options.json:
        text = json.dumps({"date": now(), "rows": rows}, indent=1) + "\n"
        options.json.write_text(text, encoding="utf-8", newline="\n")
    found = surprises(rows)
    print("\n".join(["not as expected:", *found] if found else ["as expected"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
