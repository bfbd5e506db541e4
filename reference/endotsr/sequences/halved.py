"""A sequence at half its size, made of one in memory (specification B17).

A picture is averaged over areas, a pixel is tissue where every pixel under it is, and a depth is the mean of the known
ones under it, as `sequence.scale` reduces frames that are read. Comes in and goes out: a `Sequence`.
"""

from dataclasses import replace

import numpy as np

from endotsr.sequences.depth_files import reduced_depth
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import scale_camera


def halved(sequence: Sequence) -> Sequence:
    """The same frames, times and split with floor(W/2) x floor(H/2) pixels; cameras follow the edges of the picture."""
    from endotsr.opencv import area_resize

    n, width, height = sequence.count, sequence.width // 2, sequence.height // 2
    images, masks = np.empty((n, 3, height, width), np.uint8), np.empty((n, height, width), np.bool_)
    depth = np.empty((n, height, width), np.float32)
    for i in range(n):
        images[i] = area_resize(sequence.images[i].transpose(1, 2, 0), width, height).transpose(2, 0, 1)
        masks[i] = area_resize((~sequence.masks[i]).astype(np.float32), width, height) == 0
        depth[i] = reduced_depth(sequence.depth[i], width, height)
    small = {id(camera): scale_camera(camera, width, height) for camera in sequence.cameras}
    cameras = [small[id(camera)] for camera in sequence.cameras]
    return replace(sequence, images=images, masks=masks, depth=depth, cameras=cameras)
