"""What results and times depend on: versions, processor, memory, the time of day."""

import contextlib
import datetime
import importlib.metadata
import platform
import sys
from pathlib import Path
from typing import Any, TypedDict

from endotsr import __version__
from endotsr.kernels.machine import memory_of_machine, usable_cores
from endotsr.untrusted.json import Count, Text


class MachinePart(TypedDict, total=False):
    """`machine` of run.json and of other results."""

    processor: Text
    cores: Count
    memory_bytes: Count | None
    system: Text


LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "opencv-contrib-python-headless")


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of the libraries that results depend on."""
    found = {"endotsr": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def machine() -> MachinePart:
    """Processor, cores this process may use, memory and system, as far as the system reports them."""
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
    """Largest resident memory of this process so far; None where the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        import psutil

        return getattr(psutil.Process().memory_info(), "peak_wset", None)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def dated(result: dict[str, Any]) -> dict[str, Any]:
    """The result with the date, the machine and the versions it belongs to."""
    return {"date": now(), "machine": machine(), "versions": versions()} | result


def now() -> str:
    """The time in UTC, to the second."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
