"""The world frame of a sequence, translated or scaled if float32 or the settings require it.

Positions are trained in float32. Its resolution at distance D from the origin is about 6e-8 D, and a pixel at depth z
is z / f wide: for D / z = 100 and a focal length of 2000, the resolution is a hundredth of a pixel. For larger D / z,
the origin moves to the middle of the box around the camera centres. Lengths among the settings (learning rates,
thresholds, the extent) are in millimetres and were chosen for tissue at about 60 mm. A sequence of arbitrary unit is
scaled to this median depth. A sequence in millimetres near the origin is unchanged, bit by bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, camera_centre

FAR_FROM_ORIGIN = 100.0  # times the median depth
USUAL_DEPTH = 60.0  # scene units: median depth of the sequence for which the published settings were chosen


class World(NamedTuple):
    """x_scene = (x_source - origin) * scale."""

    origin: FloatArray  # (3,) in the unit of the source
    scale: float

    @property
    def unchanged(self) -> bool:
        """Whether the world of the source is used unchanged."""
        return self.scale == 1.0 and not self.origin.any()


def fitting_world(centres: FloatArray, depth: NDArray[np.float32], arbitrary: bool) -> World:
    """The world for the training of a sequence.

    centres    (n, 3) camera centres in the world of the source
    depth      (n, H, W) view-space z, 0 = none
    arbitrary  whether the unit is unknown: the scale is then free

    Edges:  no depth at all -> unchanged.
    """
    usual = sampled_median(depth)
    if usual is None:
        return World(np.zeros(3), 1.0)
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2
    far = float(np.abs(centres).max()) > FAR_FROM_ORIGIN * usual
    return World(middle if far else np.zeros(3), USUAL_DEPTH / usual if arbitrary else 1.0)


def sampled_median(depth: NDArray[np.float32]) -> float | None:
    """The median depth among 100,000 to 200,000 pixels over all frames; None without depth.

    Smaller sequences, and those with depth at none of these pixels, count whole.
    """
    sparse = depth.reshape(-1)[:: max(1, depth.size // 100_000)]
    values = sparse[sparse > 0]
    if not values.size:
        values = depth[depth > 0]
    return float(np.median(values)) if values.size else None


def moved_camera(camera: Camera, world: World) -> Camera:
    """The camera in scene coordinates, computed in float64."""
    centre = (camera_centre(camera) - world.origin) * world.scale
    return camera._replace(translation=-camera.rotation @ centre + 0.0)  # + 0 turns -0 into 0


def moved_cameras(cameras: list[Camera], world: World) -> list[Camera]:
    """All cameras in scene coordinates. A shared object remains shared."""
    moved = {id(camera): moved_camera(camera, world) for camera in cameras}
    return [moved[id(camera)] for camera in cameras]


def world_note(world: World, unit: str) -> str:
    """A sentence on the change; "" for an unchanged world."""
    if world.unchanged:
        return ""
    place = ", ".join(f"{value:.9g}" for value in world.origin)
    return (
        f"world: scene = (source - ({place})) x {world.scale:.9g}, source lengths in {unit};"
        " positions are trained in float32 near the origin"
    )
