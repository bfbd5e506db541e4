"""Paths of points without a model: optical flow from frame to frame, lifted by the prior depth (B15).

They are compared with the true motion of a simulated scene as those of a model are
(`endotsr.results.evaluation.trajectories`): over all tissue pixels with a depth of every sixth training frame, and over
all other frames. Between two training frames a path is a straight line. No held-out picture is read.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.flow.tracks import follow
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import backproject, project
from endotsr.results.evaluation.evaluate import training_sample
from endotsr.results.evaluation.trajectories import TruePositions

Points = NDArray[np.float64]  # (3, P) or (n, 3, P) scene units


def measured(settings: dict[str, Any]) -> dict[str, float]:
    """Errors of the paths in a simulated scene, with the fraction of the points that are followed."""
    import endotsr
    from endotsr.clips.simulator.settings import SimulatorSettings
    from endotsr.training.runs.sources import SIMULATED, true_positions_of

    sequence = endotsr.load_sequence("simulated", simulator=settings)
    assert isinstance(sequence.simulator, SimulatorSettings)
    truth = true_positions_of(SIMULATED, sequence.simulator, endotsr.make_config("sharp"), sequence)
    assert truth is not None
    return errors(sequence, truth)


def errors(sequence: Sequence, truth: TruePositions) -> dict[str, float]:
    """Mean lengths of the errors, scene units and px, and the followed fraction of the points."""
    train = [int(i) for i in sequence.train_index]
    total, points = np.zeros(3), 0
    for reference in training_sample(sequence):
        known, prior = truth(reference, reference), sequence.depth[reference]
        tissue = sequence.masks[reference] & np.isfinite(known).all(axis=0) & (prior > 0)
        row, column = (place.astype(np.float64) for place in np.nonzero(tissue))
        start = backproject(sequence.cameras[reference], column, row, prior[tissue].astype(np.float64))
        origin = train.index(reference)
        tracks = follow(sequence, np.full(start.shape[1], origin), start)
        path, followed = tracks.position.astype(np.float64), tracks.followed.astype(np.float64)
        for frame in (frame for frame in range(sequence.count) if frame != reference):
            moves = at_time(sequence, path, frame) - path[origin]
            true, still = truth(reference, frame)[:, tissue], known[:, tissue]
            there, moved = (np.stack(project(sequence.cameras[frame], at)[:2]) for at in (true, still + moves))
            total += [
                np.linalg.norm(still + moves - true, axis=0).sum(),
                np.linalg.norm(moved - there, axis=0).sum(),
                at_time(sequence, followed, frame).sum(),
            ]
            points += start.shape[1]
    return dict(zip(("scene_units", "pixels", "followed"), map(float, total / points), strict=True))


def at_time(sequence: Sequence, values: NDArray[np.float64], frame: int) -> NDArray[np.float64]:
    """Values (n, ...) at the training frames, at the time of any frame: linear between two, constant outside."""
    from scipy.interpolate import make_interp_spline

    times = sequence.times[sequence.train_index]
    return make_interp_spline(times, values, k=1)(np.clip(sequence.times[frame], times[0], times[-1]))
