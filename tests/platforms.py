"""Resolve the dependencies for every system that a user may have: python tests/platforms.py [--json FILE]

pip chooses wheels for the tags of each system and version of Python, without installing anything. It needs the network
and is run by hand before a release:

    python tests/platforms.py --json docs/results/platforms.json && python docs/pages/platforms.py

A combination is `complete` where every dependency has a wheel of a final version, so that a user needs no compiler. The
exit code is 1 if a combination is not as SYSTEMS says.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SHOWN = ("numpy", "numba", "llvmlite", "scipy", "opencv-contrib-python-headless")
GLIBC = (28, 27, 26, 24, 17, 12, 5)  # of the manylinux tags that such a system takes


class System(NamedTuple):
    """A kind of machine."""

    name: str
    tags: tuple[str, ...]  # of wheels, as pip takes them; older ones of macOS follow from them
    markers: dict[str, str]  # of the environment, for requirements that name a system
    lacks: dict[str, str]  # version of Python -> why it is known to be incomplete


def _linux(processor: str) -> tuple[str, ...]:
    return (*(f"manylinux_2_{minor}_{processor}" for minor in GLIBC), f"manylinux2014_{processor}")


def _markers(os_name: str, platform: str, system: str, machine: str) -> dict[str, str]:
    return {"os_name": os_name, "sys_platform": platform, "platform_system": system, "platform_machine": machine}


WINDOWS, MAC, LINUX = ("nt", "win32", "Windows"), ("posix", "darwin", "Darwin"), ("posix", "linux", "Linux")
NO_NUMBA = {"3.14": "no final version of Numba for Intel Macs with Python 3.14"}
NO_OPENCV = dict.fromkeys(PYTHONS, "no wheel of OpenCV")
SYSTEMS = (
    System("Windows x86-64", ("win_amd64",), _markers(*WINDOWS, "AMD64"), {}),
    System("Windows ARM64", ("win_arm64",), _markers(*WINDOWS, "ARM64"), NO_OPENCV),
    System("macOS 15 Apple silicon", ("macosx_15_0_arm64",), _markers(*MAC, "arm64"), {}),
    System("macOS 14 Apple silicon", ("macosx_14_0_arm64",), _markers(*MAC, "arm64"), {}),
    System("macOS 13 Apple silicon", ("macosx_13_0_arm64",), _markers(*MAC, "arm64"), {}),
    System("macOS 12 Apple silicon", ("macosx_12_0_arm64",), _markers(*MAC, "arm64"), NO_OPENCV),
    System("macOS 15 Intel", ("macosx_15_0_x86_64",), _markers(*MAC, "x86_64"), NO_NUMBA),
    System("macOS 14 Intel", ("macosx_14_0_x86_64",), _markers(*MAC, "x86_64"), NO_NUMBA),
    System("macOS 13 Intel", ("macosx_13_0_x86_64",), _markers(*MAC, "x86_64"), NO_NUMBA),
    System("Linux x86-64", _linux("x86_64"), _markers(*LINUX, "x86_64"), {}),
    System("Linux aarch64", _linux("aarch64"), _markers(*LINUX, "aarch64"), {}),
)


def requirements(system: System, python: str) -> list[str]:
    """The dependencies of the package on a system, as words for pip; markers are those of that system."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    asked = [Requirement(line) for line in tomllib.loads(text)["project"]["dependencies"]]
    environment = system.markers | {"python_version": python, "python_full_version": f"{python}.0"}
    return [f"{r.name}{r.specifier}" for r in asked if r.marker is None or r.marker.evaluate(environment)]


def resolved(system: System, python: str) -> dict[str, Any]:
    """What pip would install: versions by name, or the reason why there is nothing."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        words = ["install", "--dry-run", "--quiet", "--ignore-installed", "--target", folder, "--report", str(report)]
        words += ["--only-binary=:all:", "--implementation", "cp", "--python-version", python]
        words += [word for tag in system.tags for word in ("--platform", tag)]
        environment = {key: value for key, value in os.environ.items() if key != "PIP_FIND_LINKS"}
        done = subprocess.run(
            [sys.executable, "-m", "pip", *words, *requirements(system, python)],
            env=environment | {"PIP_CONFIG_FILE": os.devnull, "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
            capture_output=True, text=True,
        )  # fmt: skip
        found = {"system": system.name, "python": python}
        if done.returncode:
            errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR: ")]
            return found | {"complete": False, "reason": (errors or ["pip failed"])[0].removeprefix("ERROR: ")[:200]}
        entries = [e["metadata"] for e in json.loads(report.read_text(encoding="utf-8"))["install"]]
    versions = {entry["name"].lower(): entry["version"] for entry in entries}
    early = [name for name, version in versions.items() if Version(version).is_prerelease]
    reason = {"reason": f"{early[0]} {versions[early[0]]} is no final version"} if early else {}
    return found | {"complete": not early, "versions": {name: versions[name] for name in SHOWN}} | reason


def surprises(rows: list[dict[str, Any]]) -> list[str]:
    """Combinations that are complete although SYSTEMS says otherwise, or the reverse."""
    lacks = {(system.name, python): reason for system in SYSTEMS for python, reason in system.lacks.items()}
    return [
        f"{row['system']}, Python {row['python']}: {row.get('reason', 'complete')}"
        for row in rows
        if row["complete"] == ((row["system"], row["python"]) in lacks)
    ]


def main(words: list[str]) -> int:
    """The command."""
    from endotsr.runs.machine import now

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(words)
    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(lambda pair: resolved(*pair), [(s, p) for s in SYSTEMS for p in PYTHONS]))
    for row in rows:
        said = ", ".join(f"{k} {v}" for k, v in row["versions"].items()) if row["complete"] else row["reason"]
        print(f"{row['system']:24} {row['python']:5} {'complete' if row['complete'] else 'refused':9} {said}")
    if options.json:
        text = json.dumps({"date": now(), "rows": rows}, indent=1) + "\n"
        options.json.write_text(text, encoding="utf-8", newline="\n")
    found = surprises(rows)
    print("\n".join(["not as expected:", *found] if found else ["as expected"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
