"""Equation (B12): Gaussians on the back-projected pixels of the training frames."""

import numpy as np

from endotsr.definition.appearance import Y00
from endotsr.definition.scene import Gaussians


def initialise(sequence, config, model, rng):
    """Equation (B12): Gaussians of a sequence with images (n, 3, H, W) of 8 bit, masks and depth (n, H, W).

    Without a drawn pixel there are N = 0 Gaussians; the twin raises an error.
    """
    points = [lift(sequence, k, pixels) for k, pixels in drawn_pixels(sequence, config, rng)]
    position, colour = (np.concatenate(parts, axis=1) for parts in zip(*points))
    return gaussians_at(position, colour, model)


def drawn_pixels(sequence, config, rng):
    """(frame, flat indices): pixels of the first training frame, then new or moved pixels of the others, ascending.

    Draws: one `rng.choice` in each frame with more of these pixels than are wanted.
    """
    usable = sequence.masks & (sequence.depth > 0) & np.isfinite(sequence.depth)
    first, count = sequence.train_index[0], len(sequence.images)
    for k in sequence.train_index:
        if k > first and count > 150 and (k - first) % 2 == 0:  # a long clip: every second frame
            continue
        with np.errstate(invalid="ignore"):
            moved = np.abs(sequence.depth[k] - sequence.depth[first]) > config.motion_threshold
        wanted = np.flatnonzero(usable[k] & ((k == first) | ~usable[first] | moved))
        number = config.first_frame_points if k == first else config.other_frame_points // count
        yield k, wanted if wanted.size <= number else np.sort(rng.choice(wanted, number, replace=False))


def lift(sequence, k, pixels):
    """World positions (3, M) and display colours (3, M) of flat pixel indices of frame k."""
    camera = sequence.cameras[k]
    row, column = np.divmod(pixels, sequence.masks.shape[2])
    z = sequence.depth[k, row, column].astype(float)
    x = (column + 0.5 - camera.cx) * z / camera.fx  # (3.1)
    y = (row + 0.5 - camera.cy) * z / camera.fy
    point = camera.rotation.T @ (np.array([x, y, z]) - camera.translation[:, None])  # (3.2)
    return point, sequence.images[k][:, row, column] / 255


def neighbour_distance(position):
    """(N,) mean squared distance to the 3 nearest others, from all pairwise distances. The fast path uses a tree.

    With two or three points it is the mean over the others, with one point 0.
    """
    squared = sum((axis[:, None] - axis) ** 2 for axis in position)
    return np.sort(squared, axis=1)[:, 1:4].sum(axis=1) / max(min(3, position.shape[1] - 1), 1)


def gaussians_at(position, colour, model):
    """Gaussians at the start of training, at world positions (3, N) with display colours (3, N)."""
    count = position.shape[1]
    harmonics = np.zeros(((model.harmonics_degree + 1) ** 2, 3, count))
    harmonics[0] = (colour - 0.5) / Y00  # (3.3)
    opacity_logit = np.full(count, np.log(0.1 / 0.9))  # (3.5)
    log_scale = np.log(np.sqrt(np.maximum(neighbour_distance(position), 1e-7)))  # (3.4)
    quaternion = np.repeat(np.eye(4)[:, :1], count, axis=1)
    made = Gaussians(position, quaternion, np.tile(log_scale, (3, 1)), opacity_logit, harmonics)
    if not model.deformation:
        return made
    shape = (10, model.bases, count)
    centre = np.broadcast_to(np.linspace(0, 1, model.bases)[:, None], shape)  # (3.6)
    return made._replace(fdm_weight=np.zeros(shape), fdm_centre=centre, fdm_width=np.full(shape, model.initial_width))


def activate_residuals(gaussians, count, appearance, spectral_motion):
    """Add A and C (3, 2F, N) as zeros; existing arrays are kept."""
    zero = np.zeros((3, 2 * count, gaussians.opacity_logit.size))
    a = gaussians.appearance_coefficients
    c = gaussians.motion_coefficients
    return gaussians._replace(
        appearance_coefficients=zero if appearance and a is None else a,
        motion_coefficients=zero if spectral_motion and c is None else c,
    )
