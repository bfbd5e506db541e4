"""splax (JAX) as a port: its spherical harmonics, which are plain JAX and run on a CPU.

Its projection and its rasteriser are Warp kernels behind JAX and need a GPU. Gradients are those of `jax.grad`.
"""

import jax
import numpy as np
from exchange import serve

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_platforms", "cpu")

from splax._harmonics import spherical_harmonics  # noqa: E402


def colour(inputs):
    """[channel, Gaussian]; the residual is added to the first coefficient."""
    h = inputs["harmonics"]
    h = h.at[0].add(inputs["residual"])
    towards = (inputs["position"] - inputs["centre"][:, None]).T
    return spherical_harmonics(h.transpose(2, 0, 1), towards).T


def answer(operation, inputs, settings):
    """splax's answer, None for what it does not have on a CPU."""
    if operation != "harmonics":
        return None
    names = ("harmonics", "residual", "position", "centre")
    taken = {name: jax.numpy.asarray(inputs[name]) for name in names}
    found, back = jax.vjp(colour, taken)
    (gradients,) = back(jax.numpy.asarray(inputs["d_colour"], found.dtype))
    answers = {"colour": np.asarray(found)} | {f"d_{name}": np.asarray(g) for name, g in gradients.items()}
    return {name: a.astype(inputs["position"].dtype) for name, a in answers.items()}


if __name__ == "__main__":
    serve(answer)
