"""One checked function: its inputs, outputs, cotangents and gradient, and lines through its inputs."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from endotsr.port.gradcheck.registry import Arrays

LINEAR = 1e5  # reverse passes are linear in the cotangents up to this many rounding units


class Session:
    """Inputs, outputs, dense cotangents and gradient of one check, and the faults found in them."""

    def __init__(self, forward, reverse, inputs: Arrays, trace, rng: np.random.Generator, traced=None):
        self.inputs = {name: np.array(value) for name, value in inputs.items()}
        self.rng, self.faults = rng, []
        self._reverse = reverse
        self._traced = traced or (lambda moved: (forward(moved), trace(moved) if trace else {}))
        self.decisions = trace(self.inputs) if trace else {}
        answer = forward(dict(self.inputs))
        self.bare = not isinstance(answer, Mapping)
        outputs = self._named(answer)
        self._check_outputs(outputs)
        self.cotangents = {name: self._cotangent(value) for name, value in outputs.items()}
        floats = [v.dtype for v in outputs.values() if v.ndim] or [v.dtype for v in self.inputs.values()]
        self.eps = max(float(np.finfo(t).eps) for t in floats if t.kind == "f")
        self.gradient = {}
        if not self.faults:
            self.gradient = self._gradient(self.cotangents)
            self._check_gradient()
        if not self.faults:
            self._check_linear()
        for name, value in inputs.items():
            if not np.array_equal(value, self.inputs[name], equal_nan=True):
                self.faults.append(f"input {name} was modified by the function")

    def _named(self, answer) -> dict[str, NDArray]:
        return {"output": np.asarray(answer)} if self.bare else {k: np.asarray(v) for k, v in answer.items()}

    def _cotangent(self, output: NDArray) -> NDArray:
        """Dense cotangents, never near zero, scaled for a contribution of every output."""
        size = float(np.sqrt(np.mean(np.square(output, dtype=np.float64)))) if output.size else 1.0
        draw = self.rng.choice([-1.0, 1.0], output.shape) * self.rng.uniform(0.5, 1.5, output.shape)
        return np.asarray(draw / (size if size > 0 and np.isfinite(size) else 1.0), output.dtype)

    def _gradient(self, cotangents: dict[str, NDArray]) -> dict[str, NDArray]:
        given = {name: value.copy() for name, value in cotangents.items()}
        answer = self._reverse(dict(self.inputs), given["output"] if self.bare else given)
        return {name: np.array(value) for name, value in answer.items()}

    def _check_outputs(self, outputs: dict[str, NDArray]) -> None:
        for name, value in outputs.items():
            if value.dtype.kind != "f":
                self.faults.append(f"output {name} has dtype {value.dtype}, not a float")
            elif not np.isfinite(value).all():
                self.faults.append(f"output {name} is not finite")
            elif value.size > 1 and np.ptp(value) == 0:
                self.faults.append(f"output {name} is constant: nothing is tested")

    def _check_gradient(self) -> None:
        for name, value in self.inputs.items():
            gradient = self.gradient.get(name)
            if gradient is None:
                self.faults.append(f"no gradient for input {name}")
            elif gradient.shape != value.shape:
                self.faults.append(f"gradient of {name} has shape {gradient.shape}, the input {value.shape}")
            elif not np.isfinite(gradient).all():
                self.faults.append(f"gradient of {name} is not finite at {_first(~np.isfinite(gradient))}")
        self.gradient = {name: value for name, value in self.gradient.items() if name in self.inputs}

    def _check_linear(self) -> None:
        """Check linearity: the gradients of half of each cotangent must add up to half the gradient."""
        total = {name: np.zeros(value.shape) for name, value in self.gradient.items()}
        for one in self.cotangents:
            alone = {k: v * v.dtype.type(0.5) if k == one else np.zeros_like(v) for k, v in self.cotangents.items()}
            for name, value in self._gradient(alone).items():
                if name in total:
                    total[name] = total[name] + value
        for name, value in self.gradient.items():
            gap, size = norm(total[name] - 0.5 * value), 0.5 * norm(value)
            if not gap <= LINEAR * self.eps * size:
                self.faults.append(f"gradient of {name} is not linear in the cotangents: {gap:.1e} of {size:.1e}")

    def line(self, direction: Mapping[str, NDArray]) -> Callable[[float], NDArray | None]:
        """h -> outputs times cotangents at inputs + h direction; None if the decisions differ."""

        def at(step: float) -> NDArray | None:
            moved = dict(self.inputs)
            for name, v in direction.items():
                moved[name] = (self.inputs[name] + step * v).astype(self.inputs[name].dtype)
            answer, decisions = self._traced(moved)
            if not _equal(decisions, self.decisions):
                return None
            outputs = self._named(answer)
            terms = [(np.float64(self.cotangents[k]) * np.float64(v)).ravel() for k, v in outputs.items()]
            return terms[0] if len(terms) == 1 else np.concatenate(terms)

        return at

    def analytic(self, direction: Mapping[str, NDArray]) -> float:
        """Sum over the inputs of <gradient, direction>."""
        return float(sum(np.sum(np.float64(self.gradient[name]) * v) for name, v in direction.items()))


def _equal(one: Mapping[str, NDArray], two: Mapping[str, NDArray]) -> bool:
    return one.keys() == two.keys() and all(np.array_equal(one[k], two[k]) for k in one)


def norm(*values: NDArray) -> float:
    return float(np.sqrt(sum(np.sum(np.square(v, dtype=np.float64)) for v in values)))


def _first(mask: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(i[0]) for i in np.nonzero(mask))
