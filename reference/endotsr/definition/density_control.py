"""Equation (B11): density control."""

from collections import namedtuple

import numpy as np

from endotsr.definition.compositing import opacity_of
from endotsr.definition.covariance import rotation_of, unit

DensityStatistics = namedtuple("DensityStatistics", "gradient_sum visits")  # (N,) each
# Source column of every Gaussian; those from `survivors` on are new and have zero moments.
GatherPlan = namedtuple("GatherPlan", "source survivors")
Densified = namedtuple("Densified", "gaussians plan statistics cloned split pruned")


def empty_statistics(count):
    """Zeros for N Gaussians."""
    return DensityStatistics(np.zeros(count), np.zeros(count))


def gather_statistics(statistics, d_mean, visible, width, height):
    """Equation (B11): add one view to the statistics; d_mean (2, N) per px, visible (N,)."""
    norm = np.sqrt((width / 2 * d_mean[0]) ** 2 + (height / 2 * d_mean[1]) ** 2)  # (13.6)
    return DensityStatistics(statistics.gradient_sum + np.where(visible, norm, 0), statistics.visits + visible)


def scene_extent(config, cameras):
    """Scene units: a number, or 1.1 x the largest distance of a camera from their mean, 0 for a static camera."""
    if config.extent != "cameras":
        return config.extent
    centres = np.array([-camera.rotation.T @ camera.translation for camera in cameras])
    return 1.1 * np.sqrt(((centres - centres.mean(axis=0)) ** 2).sum(axis=1)).max()


def densify(gaussians, statistics, config, rng, extent, remaining=1):
    """Equation (B11): prune, clone and split, with `remaining` runs left, this one included.

    Draws: one `rng.standard_normal((2, 3, splits))`, none without a split.
    """
    alive = opacity_of(gaussians.opacity_logit) >= config.prune_opacity
    steepness = statistics.gradient_sum / np.maximum(statistics.visits, 1)
    by_threshold = config.growth == "threshold"
    steep = steepness >= config.gradient_threshold if by_threshold else steepness > 0
    runs = 1 if by_threshold else remaining  # a budget is shared by the runs that are left
    candidates = np.flatnonzero(alive & steep)  # (13.7)
    room = -(-max(0, config.maximum - alive.sum()) // runs)  # (20.1), (20.3)
    steepest_first = candidates[np.argsort(-steepness[candidates], kind="stable")]
    candidates = np.sort(steepest_first[:room])
    large = np.exp(gaussians.log_scale[:, candidates]).max(axis=0, initial=0) > config.dense_fraction * extent
    clone = candidates[~large]
    split = candidates[large]  # (13.8)
    survivors = np.setdiff1d(np.flatnonzero(alive), split)
    source = np.concatenate([survivors, clone, split, split])
    made = type(gaussians)(*(None if array is None else array[..., source] for array in gaussians))
    if split.size:
        made = with_children(made, rng.standard_normal((2, 3, split.size)))
    plan = GatherPlan(source, survivors.size)
    return Densified(made, plan, empty_statistics(source.size), clone.size, split.size, (~alive).sum())


def with_children(gaussians, noise):
    """Move the last Gaussians, copies of their parents, to samples of the parents and shrink them by 1.6.

    noise (2, 3, splits) [child, axis, parent]: all first children come before all second ones.
    """
    noise = np.concatenate(noise, axis=1)
    children = slice(gaussians.opacity_logit.size - noise.shape[1], None)
    rotation = rotation_of(unit(gaussians.quaternion[:, children])[0])
    position, log_scale = gaussians.position.copy(), gaussians.log_scale.copy()
    axes = np.exp(np.clip(log_scale[:, children], -40, 40))
    position[:, children] += np.einsum("ijn,jn->in", rotation, axes * noise)
    log_scale[:, children] -= np.log(1.6)
    return gaussians._replace(position=position, log_scale=log_scale)
