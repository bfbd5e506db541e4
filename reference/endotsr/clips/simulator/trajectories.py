"""True trajectories of material points: world and image positions at every frame time.

In: a `SimulatedSequence` and material coordinates in millimetres, for example at chosen pixels of a frame
(`material_at`). Out: `MaterialTracks`. World axes are the axes of the camera at rest: x right, y down, z forward, in
millimetres. Positions come from the formula of the surface, without interpolation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.simulator.simulate import SimulatedSequence
from endotsr.clips.simulator.surface import Surface, surface_point
from endotsr.clips.simulator.views import pixel_of, see_rays
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera


class MaterialTracks(NamedTuple):
    """Trajectories of P material points over n frames."""

    material: FloatArray  # (2, P)      material coordinates a, b, mm
    position: FloatArray  # (n, 3, P)   world position at each frame time, mm
    pixel: FloatArray  # (n, 2, P)   image position, px, x first; the centre of the first pixel is (0.5, 0.5)
    depth: FloatArray  # (n, P)      view-space z, mm
    visible: NDArray[np.bool_]  # (n, P)      inside the picture and not covered by an instrument


def material_at(simulated: SimulatedSequence, pixel: FloatArray, frame: int = 0) -> FloatArray:
    """Material coordinates of the tissue at image positions of one frame.

    pixel    (2, P) px, x first; the first pixel centre is (0.5, 0.5); positions outside the picture are allowed
    frame    index of the frame; frame 0 shows the tissue at rest
    returns  (2, P) mm; of the hidden tissue behind an instrument; NaN in the wound of a slit

    Raises:  IndexError for a frame outside the sequence; InputError if a ray misses the tissue.
    """
    sequence = simulated.sequence
    if not 0 <= frame < sequence.count:
        raise IndexError(f"frame {frame} of a sequence of {sequence.count}")
    camera = sequence.cameras[frame]
    x, y = np.asarray(pixel, float)
    ray_x, ray_y = (x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy
    view = see_rays(simulated.truth.surface, camera, float(sequence.times[frame]), ray_x, ray_y)
    return view.material if view.wound is None else np.where(view.wound, np.nan, view.material)


def material_tracks(simulated: SimulatedSequence, material: FloatArray) -> MaterialTracks:
    """The trajectories of material points (2, P), mm, at all frame times.

    Edges:   P = 0 gives empty arrays. A point behind the camera is not visible, and its pixel is NaN.
    """
    sequence, truth = simulated.sequence, simulated.truth
    tracks = empty_tracks(material, sequence.count)
    for i, (camera, t) in enumerate(zip(sequence.cameras, sequence.times)):
        follow(tracks, i, truth.surface, camera, float(t), truth.instrument[i])
    return tracks


def empty_tracks(material: FloatArray, count: int) -> MaterialTracks:
    """Tracks of material points (2, P) over `count` frames, to be filled by `follow`."""
    material = np.asarray(material, float)
    n, points = count, material.shape[1]
    return MaterialTracks(
        material, np.empty((n, 3, points)), np.empty((n, 2, points)), np.empty((n, points)), np.empty((n, points), bool)
    )


def follow(
    tracks: MaterialTracks, i: int, surface: Surface, camera: Camera, t: float, covered: NDArray[np.bool_]
) -> None:
    """Fill frame i of the tracks. covered (H, W): pixels covered by an instrument."""
    tracks.position[i] = surface_point(surface, tracks.material, t)
    found = pixel_of(camera, tracks.position[i])
    tracks.pixel[i], tracks.depth[i] = found[:2], found[2]
    tracks.visible[i] = _visible(tracks.pixel[i], covered)


def _visible(pixel: FloatArray, covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether image positions are in the picture and not covered by an instrument. The sheet never occludes itself."""
    height, width = covered.shape
    x, y = pixel
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    column, row = np.where(inside, x, 0).astype(np.intp), np.where(inside, y, 0).astype(np.intp)
    return inside & ~covered[row, column]
