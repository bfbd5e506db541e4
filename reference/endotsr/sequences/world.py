"""The world frame of a sequence, moved and scaled where float32 or the settings would not suffice.

Positions are trained in float32. Its steps at the distance D from the origin are about 6e-8 D, and a pixel at the depth
z is z / f wide, so that D / z of 100 leaves a hundredth of a pixel for a focal length of 2000. Beyond that, the origin
moves to the middle of the camera centres. Lengths among the settings (learning rates, thresholds, the extent) are
millimetres and were chosen for tissue at about 60 mm; a sequence whose unit is arbitrary is scaled so that its median
depth is that. A sequence in millimetres near the origin is returned as it is, bit by bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import FloatArray
from endotsr.splatting.camera import Camera, camera_centre

FAR_FROM_ORIGIN = 100.0  # times the median depth
USUAL_DEPTH = 60.0  # scene units: median depth of the sequence that the published settings were chosen on


class World(NamedTuple):
    """x_scene = (x_source - origin) * scale."""

    origin: FloatArray  # (3,) in the unit of the source
    scale: float

    @property
    def unchanged(self) -> bool:
        """Whether the scene is the world of the source."""
        return self.scale == 1.0 and not self.origin.any()


def fitting_world(centres: FloatArray, depth: NDArray[np.float32], arbitrary: bool) -> World:
    """The world in which a sequence is trained.

    centres    (n, 3) camera centres in the world of the source
    depth      (n, H, W) view-space z, 0 = none
    arbitrary  whether the unit is unknown: the scale is then free

    Edges:  no depth at all -> unchanged.
    """
    usual = usual_depth(depth)
    if usual is None:
        return World(np.zeros(3), 1.0)
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2
    far = float(np.abs(centres).max()) > FAR_FROM_ORIGIN * usual
    return World(middle if far else np.zeros(3), USUAL_DEPTH / usual if arbitrary else 1.0)


def usual_depth(depth: NDArray[np.float32]) -> float | None:
    """The median depth of about 100,000 pixels over all frames that have depth; None if none has."""
    sparse = depth.reshape(-1)[:: max(1, depth.size // 100_000)]
    values = sparse[sparse > 0]
    if not values.size:
        values = depth[depth > 0]
    return float(np.median(values)) if values.size else None


def moved_camera(camera: Camera, world: World) -> Camera:
    """The camera in the coordinates of the scene, computed in float64."""
    centre = (camera_centre(camera) - world.origin) * world.scale
    return camera._replace(translation=-camera.rotation @ centre + 0.0)  # + 0 turns -0 into 0


def moved_cameras(cameras: list[Camera], world: World) -> list[Camera]:
    """All cameras in the coordinates of the scene; what was one and the same object stays one."""
    moved = {id(camera): moved_camera(camera, world) for camera in cameras}
    return [moved[id(camera)] for camera in cameras]


def world_note(world: World, unit: str) -> str:
    """A sentence on the change; "" if there is none."""
    if world.unchanged:
        return ""
    place = ", ".join(f"{value:.9g}" for value in world.origin)
    return (
        f"world: scene = (source - ({place})) x {world.scale:.9g}, lengths of the source in {unit};"
        " positions are trained in float32 near the origin"
    )
