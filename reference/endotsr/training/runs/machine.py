"""The environment of a result: versions, processor, memory, date."""

import contextlib
import datetime
import importlib.metadata
import platform
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

from endotsr import __version__
from endotsr.method.kernels.machine import memory_of_machine, usable_cores
from endotsr.untrusted.json import Count, Keys, Text


class MachinePart(TypedDict, total=False):
    """The entry `machine` of run.json and of other results."""

    processor: Text
    cores: Count
    memory_bytes: Count | None
    system: Text


LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "opencv-contrib-python-headless")


def versions() -> dict[str, str]:
    """Versions of this package, of Python, and of the libraries that affect results."""
    found = {"endotsr": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def machine() -> MachinePart:
    """Processor, cores available to this process, memory and system; memory is None if unknown."""
    processor = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                processor = line.split(":", 1)[1].strip()
                break
    return {
        "processor": processor,
        "cores": usable_cores(),
        "memory_bytes": memory_of_machine(),
        "system": platform.platform(),
    }


def peak_memory_bytes() -> int | None:
    """Peak resident memory of this process; None if the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        import psutil

        return getattr(psutil.Process().memory_info(), "peak_wset", None)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def dated(result: Mapping[str, Any]) -> Keys:
    """The result with date, machine and versions."""
    return {"date": now(), "machine": machine(), "versions": versions(), **result}


def now() -> str:
    """The current UTC time, ISO 8601, to the second."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
