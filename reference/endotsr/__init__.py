"""endotsr: the reference implementation of Endo-TSR on the CPU.

Ten lines of Python load a sequence, train on it and render: see `endotsr.api`. The names in `__all__` are stable.
Importing this package imports nothing heavy; a name is imported when it is first used.

The storeys of the package, from the ground up. Each imports only what stands above it in this list:

    errors, untrusted   refusals, and what every file of another person passes before it is read
    config              the settings and their presets
    definition          the method as text: plain NumPy, one file per equation
    method              the same functions compiled: kernels, equations, losses, splatting
    clips               input: sequences, the simulator, tests for effects
    training            the Gaussians, one iteration, schedules, run folders
    results             metrics, reports, views, files for other programs
    port                gradient checks, golden cases and their judge
    studies             benchmarks, sweeps, windows of long recordings
    api, cli            the Python interface, and the commands

Every forward pass `<operation>_forward` has its manual reverse pass `<operation>_reverse` directly below it.
"""

TYPE_CHECKING = False  # as in `typing`, whose import would be the heaviest part of this one
if TYPE_CHECKING:
    from typing import Any

    from endotsr.api import (
        Run,
        StopTraining,
        estimate_poses,
        inspect,
        load_sequence,
        make_config,
        open_run,
        train,
    )
    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.config import Config
    from endotsr.errors import CalibrationError, InputError
    from endotsr.method.splatting.camera import Camera
    from endotsr.method.splatting.render import RenderOut

__version__ = "0.1.0"

__all__ = [
    "CalibrationError",
    "Camera",
    "Config",
    "InputError",
    "RenderOut",
    "Run",
    "Sequence",
    "StopTraining",
    "__version__",
    "estimate_poses",
    "inspect",
    "load_sequence",
    "make_config",
    "open_run",
    "train",
]

_MODULES = {
    "CalibrationError": "endotsr.errors",
    "Camera": "endotsr.method.splatting.camera",
    "Config": "endotsr.config",
    "InputError": "endotsr.errors",
    "RenderOut": "endotsr.method.splatting.render",
    "Run": "endotsr.api",
    "Sequence": "endotsr.clips.sequences.sequence",
    "StopTraining": "endotsr.api",
    "estimate_poses": "endotsr.api",
    "inspect": "endotsr.api",
    "load_sequence": "endotsr.api",
    "make_config": "endotsr.api",
    "open_run": "endotsr.api",
    "train": "endotsr.api",
}


def __getattr__(name: str) -> "Any":
    """A public name, imported at its first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
