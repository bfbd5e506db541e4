"""Rendered depth of the held-out frames against the prior depth, which training never saw there.

The prior is no truth: it comes from stereo matching, and its errors count as errors here. The rows without a model
predict the prior of a frame from those of training frames, so they share its way of erring.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from endotsr.evaluation.baselines import neighbours
from endotsr.kernels.arrays import BoolArray, FloatArray
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderOut

LEAST_OPACITY = 0.5  # of a pixel whose rendered depth counts; below, the render is mostly background


def normalised_depth(out: RenderOut, least_opacity: float = 0.0) -> FloatArray:
    """Depth divided by opacity: the mean depth of what is seen, also where the scene is translucent.

    least_opacity  of a pixel that has a depth
    returns        (H, W) scene units; 0 = below the least opacity, or no opacity. The rendered depth itself is the sum
                   over Gaussians with their weights, which approaches 0 where little is opaque
    """
    seen = (out.opacity > 0) & (out.opacity >= least_opacity)
    return np.where(seen, out.depth / np.where(seen, out.opacity, 1), 0).astype(out.depth.dtype)


def held_out_depth(sequence: Sequence, render: Callable[[int, Camera], RenderOut]) -> dict[str, Any]:
    """Errors over the tissue pixels of the held-out frames that have a prior, in scene units.

    render   frame number and camera -> render
    returns  {"unit", "rows": [{"label", "mean_absolute", "root_mean_square", "relative", "covered"}]}: the model, the
             blend of the priors of the two neighbouring training frames, and the prior of the nearest one. `relative`
             is the mean of error / prior; `covered` the fraction of the pixels for which there is a prediction, and
             the errors are those of the pixels that all rows cover
    """
    makers = {
        "this model": lambda i: normalised_depth(render(i, sequence.cameras[i]), LEAST_OPACITY),
        "blend of the neighbouring priors": lambda i: blended_prior(sequence, i),
        "prior of the nearest training frame": lambda i: sequence.depth[neighbours(sequence, i).nearest],
    }
    columns: dict[str, list[FloatArray]] = {label: [] for label in makers}
    truths, covered = [], dict.fromkeys(makers, 0)
    total = 0
    for i in map(int, sequence.test_index):
        made = {label: maker(i) for label, maker in makers.items()}
        known = sequence.masks[i] & (sequence.depth[i] > 0)
        common: BoolArray = np.logical_and.reduce([known, *(depth > 0 for depth in made.values())])
        total += int(known.sum())
        truths.append(sequence.depth[i][common])
        for label, depth in made.items():
            covered[label] += int((known & (depth > 0)).sum())
            columns[label].append(depth[common])
    truth = np.concatenate(truths).astype(np.float64) if truths else np.empty(0)
    if not truth.size:
        return {"reason": "no held-out frame has a prior depth on tissue"}
    rows = [
        _errors(label, np.concatenate(parts), truth) | {"covered": covered[label] / total}
        for label, parts in columns.items()
    ]
    return {"unit": sequence.unit, "rows": rows}


def _errors(label: str, depth: FloatArray, truth: FloatArray) -> dict[str, Any]:
    error = np.abs(depth.astype(np.float64) - truth)
    return {
        "label": label,
        "mean_absolute": float(error.mean()),
        "root_mean_square": float(np.sqrt(np.square(error).mean())),
        "relative": float((error / truth).mean()),
    }


def blended_prior(sequence: Sequence, index: int) -> FloatArray:
    """The priors of the training frames before and after, blended in time; where one has none, the other's. (H, W)."""
    near = neighbours(sequence, index)
    before, after = sequence.depth[near.before], sequence.depth[near.after]
    both = (before > 0) & (after > 0)
    blend = before + np.float32(near.fraction) * (after - before)
    return np.where(both, blend, np.maximum(before, after))
