"""How far the training moved the cameras of a run (B16).

In: a sequence with its given poses, and with those that the model sees it by. Out: means over the training frames. A
common motion of all cameras counts too, although it changes no picture.
"""

from typing import cast

import numpy as np

from endotsr.evaluation.records import PosePart
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera, backproject, camera_centre, degrees_between, project

POINTS = 8  # along each side of the picture


def pose_change(given: Sequence, seen: Sequence) -> PosePart | None:
    """Mean change of the training cameras; None if both are the same sequence.

    returns  `degrees` between the rotations, `scene_units` between the optical centres, `pixels` between the places of
             points at the median depth of the tissue, and the `unit` of the scene
    """
    if seen is given:
        return None
    rows = [_change(given, int(i), seen.cameras[i]) for i in given.train_index]
    names = ("degrees", "scene_units", "pixels")
    means = dict(zip(names, np.mean(rows, axis=0).tolist(), strict=True))
    return cast(PosePart, means | {"unit": given.unit})


def _change(sequence: Sequence, index: int, seen: Camera) -> tuple[float, float, float]:
    """Angle in degrees, distance in scene units, and mean displacement in pixels of one frame."""
    camera, depth = sequence.cameras[index], sequence.tissue_depth(index) or 1.0
    moved = float(np.linalg.norm(camera_centre(seen) - camera_centre(camera)))
    ends = (np.linspace(0, size - 1, POINTS) for size in (camera.height, camera.width))
    row, column = (a.ravel() for a in np.meshgrid(*ends, indexing="ij"))
    points = backproject(camera, column, row, np.full(row.size, depth))
    apart = np.subtract(project(seen, points)[:2], project(camera, points)[:2])
    return degrees_between(seen.rotation, camera.rotation), moved, float(np.hypot(*apart).mean())
