"""Rendered depth of the held-out frames compared with their prior depth, which is no target of the training.

Except in a simulated sequence, the prior is no ground truth: it comes from stereo matching, from a network or from
another measurement, and its errors count as errors here. The rows without a model predict a prior from the priors of
training frames. Errors that these have in common with it do not count against these rows, which favours them.
"""

from collections.abc import Callable

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.baselines import neighbours
from endotsr.results.evaluation.records import Measured, MeasureRow

LEAST_OPACITY = 0.5  # minimum opacity of a pixel with valid depth; below, the render is mostly background


def normalised_depth(out: RenderOut, least_opacity: float = 0.0) -> FloatArray:
    """Rendered depth divided by opacity: the weighted mean depth of the visible Gaussians.

    The rendered depth is the weighted sum, which approaches 0 with the opacity.

    least_opacity  minimum opacity of a pixel with depth
    returns        (H, W) scene units; 0 where the opacity is 0 or below the minimum
    """
    seen = (out.opacity > 0) & (out.opacity >= least_opacity)
    return np.where(seen, out.depth / np.where(seen, out.opacity, 1), 0).astype(out.depth.dtype)


def held_out_depth(sequence: Sequence, render: Callable[[int, Camera], RenderOut]) -> Measured:
    """Errors over the tissue pixels of the held-out frames that have a prior, in scene units.

    render   frame number and camera -> render
    returns  {"unit", "rows": [{"label", "mean_absolute", "root_mean_square", "relative", "covered"}]} for the model,
             the blend of the priors of the two neighbouring training frames, and the prior of the nearest one; or
             {"reason"}. `relative` is the mean of error / prior, `covered` the fraction of pixels with a prediction.
             Errors are taken over the pixels with a prediction in all rows
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
    if not total:
        return {"reason": "no held-out frame has a prior depth on tissue"}
    if not truth.size:
        return {"reason": "no pixel of the held-out priors has a depth in the model and in the training priors too"}
    rows = [
        _errors(label, np.concatenate(parts), truth) | {"covered": covered[label] / total}
        for label, parts in columns.items()
    ]
    return {"unit": sequence.unit, "rows": rows}


def _errors(label: str, depth: FloatArray, truth: FloatArray) -> MeasureRow:
    error = np.abs(depth.astype(np.float64) - truth)
    return {
        "label": label,
        "mean_absolute": float(error.mean()),
        "root_mean_square": float(np.sqrt(np.square(error).mean())),
        "relative": float((error / truth).mean()),
    }


def blended_prior(sequence: Sequence, index: int) -> FloatArray:
    """The priors of the training frames before and after, blended in time; a missing one is replaced. (H, W)."""
    near = neighbours(sequence, index)
    before, after = sequence.depth[near.before], sequence.depth[near.after]
    both = (before > 0) & (after > 0)
    blend = before + np.float32(near.fraction) * (after - before)
    return np.where(both, blend, np.maximum(before, after))
