"""The mutated functions: all of the numerical modules, kernels and the plain Python around them alike."""

import ast
import importlib
import inspect
from collections.abc import Callable

MODULES = (
    "method.kernels.exponential",
    "method.kernels.gather",
    *(f"method.equations.{name}" for name in ("dictionary", "atom_sums", "appearance", "motion", "matern")),
    *(
        f"method.equations.{name}"
        for name in ("pyramid", "laplacian", "calibration", "deformation", "exposure", "pose")
    ),
    *(f"method.splatting.{name}" for name in ("camera", "camera_model", "covariance", "projection")),
    *(
        f"method.splatting.{name}"
        for name in ("projection_formulas", "projection_kernels", "harmonics", "harmonics_formulas")
    ),
    "method.kernels.sums",
    *(
        f"method.splatting.{name}"
        for name in ("records", "binning", "compositing", "fast.blocks", "fast.tiles", "render")
    ),
    *(f"method.losses.{name}" for name in ("rows", "masked_l1", "masked_ssim", "depth", "smoothness")),
    "training.scene.density_control",
    *(f"training.fitting.{name}" for name in ("adam", "fused.coefficients", "fused.deformation", "model", "objective")),
    "training.fitting.schedules",
)
# functions in which only a named defect is planted
MORE = ("training.fitting.state.training_constants",)


def kernels() -> dict[str, Callable]:
    """Plain Python functions by name, such as `method.losses.rows._row_total`."""
    found: dict[str, Callable] = {}
    for name in MODULES:
        module = importlib.import_module(f"endotsr.{name}")
        for node in ast.parse(inspect.getsource(module)).body:
            if isinstance(node, ast.FunctionDef) and not _for_the_compiler(node):
                found[f"{name}.{node.name}"] = _plain(getattr(module, node.name))
    return found


def planted() -> dict[str, Callable]:
    """Functions beside the kernels in which a named defect is planted."""
    parts = [name.rsplit(".", 1) for name in MORE]
    return {f"{m}.{f}": getattr(importlib.import_module(f"endotsr.{m}"), f) for m, f in parts}


def _plain(function: Callable) -> Callable:
    """The function without the wrapper of a compiler or a cache."""
    function = getattr(function, "py_func", function)
    return inspect.unwrap(function)


def _for_the_compiler(node: ast.FunctionDef) -> bool:
    """Whether a function only instructs Numba what to compile; such a function never runs uncompiled."""
    return any(isinstance(d, ast.Call) and getattr(d.func, "id", "") == "overload" for d in node.decorator_list)


def clear_caches() -> None:
    """Clear the cached results of unchanged functions."""
    for name in MODULES:
        for value in vars(importlib.import_module(f"endotsr.{name}")).values():
            if hasattr(value, "cache_clear"):
                value.cache_clear()
