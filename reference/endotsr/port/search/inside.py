"""The first wrong array inside an operation, from intermediate arrays that a port may write after a refusal.

In: `<family>/<case>/inside/<name>.npy`, next to the outputs of a refused case. Out: the first wrong array, in the order
of computation of the definition. The expected values are computed from variables of the definition at the end of one
of its functions; no vector stores them.
"""

import contextlib
import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.relate import FITS, relations
from endotsr.port.operations.operation import Operation
from endotsr.port.search.cases import Answered

FOLDER = "inside"
MOST_BYTES = 1 << 27


class Inner(NamedTuple):
    """Location of an array in the definition: an expression of a function's variables, at its end."""

    function: str
    value: str  # `returned` is the return value


def of_gaussians(layers: Sequence[Any], rows: NDArray, columns: NDArray, image: Callable[[Any], NDArray]) -> NDArray:
    """(N, H, W) images of the layers by Gaussian, 0 for a Gaussian without a layer."""
    found = np.zeros((rows.shape[1], rows.shape[0], columns.shape[0]))
    for layer in layers:
        found[layer.index] = image(layer)
    return found


_UNIT = {"unit_quaternion": Inner("covariance.unit", "returned[0]")}
_LENS = {
    "point": Inner("projection.projection_forward", "np.where(visible, point, 0)"),
    "jacobian": Inner("projection.projection_forward", "np.where(visible, jacobian(point, camera, settings)[0], 0)"),
    "t": Inner("projection.projection_forward", "np.where(visible, np.einsum('ikn,kln->iln', t, shape.rotation), 0)"),
}
_CONIC = {
    "determinant": Inner("projection.projection_forward", "values[5]"),
    "conic": Inner("projection.projection_forward", "np.where(visible, np.array([c, -b, a]) / (a * c - b * b), 0)"),
}
_SCREEN = {
    "mean2d": Inner("projection.projection_forward", "values[:2]"),
    "covariance2d": Inner("projection.projection_forward", "values[2:5]"),
}
_COLOUR = {
    "direction": Inner("harmonics.directions", "returned[0]"),
    "basis": Inner("harmonics.basis", "returned"),
    "unclamped": Inner("harmonics.harmonics_forward", "colour"),
}
_BLEND = {
    "opacity": Inner("compositing.layers_of", "opacity"),
    "tile_columns": Inner("compositing.layers_of", "{'three_sigma_tiles': columns.T}[settings.support]"),
    "tile_rows": Inner("compositing.layers_of", "{'three_sigma_tiles': rows.T}[settings.support]"),
    "alpha": Inner("compositing.layers_of", "of_gaussians(layers, rows, columns, lambda layer: layer.alpha)"),
    "weight": Inner(
        "compositing.layers_of",
        "of_gaussians(layers, rows, columns, lambda layer: layer.taken * layer.alpha * layer.front)",
    ),
    "transmittance": Inner("compositing.layers_of", "t"),
}
_WINDOWED = {
    "mu_x": "mu_x", "mu_y": "mu_y", "sigma_xx": "blurred(x**2) - mu_x**2", "sigma_yy": "blurred(y**2) - mu_y**2",
    "sigma_xy": "blurred(x * y) - mu_x * mu_y", "map": "s",
}  # fmt: skip
_LEVELS = {
    name: value
    for k in (1, 2, 3)
    for name, value in (
        (f"pyramid_{k}", f"laplacian_levels(images[0], {k}, upsampling).coarse"),
        (f"rendered_band_{k}", f"one[{k - 1}]"),
    )
}


def _inner(function: str, **found: str) -> dict[str, Inner]:
    return {name: Inner(function, value) for name, value in found.items()}


INSIDE: dict[str, dict[str, Inner]] = {
    "dictionary": _inner("dictionary.dictionary_forward", turns="turns"),
    "appearance": _inner("appearance.appearance_forward", x="x"),
    "deformation": _inner("deformation.bell", delta="delta", sigma="sigma", basis="returned[2]"),
    "covariance": _UNIT,
    "projection": _LENS | _CONIC,
    "harmonics": _COLOUR,
    "composite": _BLEND,
    "render": _UNIT | _LENS | _SCREEN | _CONIC | _COLOUR | _BLEND,
    "masked_ssim": _inner("masked_ssim.masked_ssim_forward", **_WINDOWED),
    "normalised_depth": _inner(
        "depth.normalised_depth_forward", prior="target.normalised", largest="largest", residual="residual"
    ),
    "laplacian": _inner("laplacian.laplacian_loss_forward", **_LEVELS),
    "pose": _inner("pose.pose_forward", exponential="e"),
}
"""Arrays by operation and name, in the order of computation of the definition."""


def values(operation: Operation, one: Answered) -> dict[str, NDArray]:
    """The arrays of a case, from the first call of each function; arrays that the case does not reach are omitted."""
    wanted = INSIDE.get(operation.name, {})
    functions = {_code(inner.function): inner.function for inner in wanted.values()}
    names: dict[str, Mapping[str, Any]] = {}

    def seen(frame: Any, event: str, returned: Any) -> None:
        function = functions.get(frame.f_code) if event == "return" else None
        if function and function not in names:  # the first call
            names[function] = {**frame.f_globals, **frame.f_locals, "returned": returned, "of_gaussians": of_gaussians}

    before = sys.getprofile()
    sys.setprofile(seen)
    try:
        one.forward(operation, one.inputs, one.settings)
    finally:
        sys.setprofile(before)
    found = {}
    for name, inner in wanted.items():
        with np.errstate(all="ignore"), contextlib.suppress(NameError, KeyError):  # a case that ends early
            found[name] = np.asarray(eval(inner.value, dict(names[inner.function])))
    return found


def _code(function: str) -> Any:
    module, _, name = function.rpartition(".")
    return getattr(importlib.import_module(f"endotsr.definition.{module}"), name).__code__


def bisected(operation: Operation, one: Answered) -> list[str]:
    """A sentence on the arrays that a port wrote for a case; empty if it wrote none."""
    expected, right, wrong = values(operation, one), [], []
    for name, array in expected.items():
        try:
            got = read_plain(one.folder / FOLDER / f"{name}.npy", one.folder, MOST_BYTES)
        except Refused as refusal:
            if str(refusal) != "missing":
                wrong.append(f"{name}: {refusal}")
            continue
        said = compared(got, array, one.tolerance, {**one.inputs, **expected}, name)
        if said:
            wrong.append(f"{name}: {said}")
        elif not wrong:  # one after a wrong array does not narrow the search
            right.append(name)
    if not right and not wrong:
        return []
    after = f"; right before it: {', '.join(right)}" if right else ""
    if not wrong:
        return [
            f"inside {one.case.name} {', '.join(right)} {'are' if len(right) > 1 else 'is'} right: look at what follows"
        ]
    return [f"inside {one.case.name} the first wrong array is {wrong[0]}{after}"]


def compared(got: NDArray, array: NDArray, tolerance: float, others: Mapping[str, NDArray], name: str) -> str:
    """The difference of an array from the definition's as text, "" if there is none."""
    if got.shape != array.shape:
        return f"shape {got.shape}; expected {array.shape}"
    rest = {key: other for key, other in others.items() if key != name}
    allowed = FITS * tolerance if array.dtype.kind == "f" else 0.0
    return "; ".join(one.text for one in relations(got, array, "max", allowed, rest)[:2])


def asked(operation: Operation, one: Answered) -> str:
    """The arrays that a port may write for a case, "" if there are none."""
    names = values(operation, one)
    if not names:
        return ""
    shapes = ", ".join(f"{name} {array.shape}" for name, array in names.items())
    return f"to look inside {one.case.name}, write any of these into {one.case.name}/{FOLDER}/: {shapes}"


def looked(operation: Operation, cases: Sequence[Answered]) -> tuple[list[str], str]:
    """A sentence on the arrays of one refused case, one with a wrong array if there is any.

    Without arrays of the port it is empty; then the second text names those that the port may write.
    """
    refused = [one for one in cases if one.refused]
    said = [found for one in refused if (found := bisected(operation, one))]
    said.sort(key=lambda found: " wrong " not in found[0])
    return (said[0], "") if said else ([], asked(operation, refused[0]))
