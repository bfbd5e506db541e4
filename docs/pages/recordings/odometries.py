"""Ways to the poses of a clip: `endotsr poses` and the programs that it is compared with.

In: a `Sequence` with depth. Out: `Found`, one pose per frame or None. All of them get the same pictures, the same
usable pixels and, except pycolmap, the same depth. pycolmap is used if it is installed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from endotsr.clips.poses.views import IDENTITY, Views, compose, known_depth, usable_pixels
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import CameraPose


class Found(NamedTuple):
    """World-to-camera poses."""

    poses: list[CameraPose | None]  # None: not registered
    scaled: bool = False  # the unit of lengths is arbitrary


def usable(sequence: Sequence) -> np.ndarray:
    """(n, H, W) pixels that every method may use."""
    return np.array([usable_pixels(image, mask) for image, mask in zip(sequence.images, sequence.masks, strict=True)])


def static(sequence: Sequence) -> Found:
    """No motion."""
    return Found([IDENTITY] * sequence.count)


def by_endotsr(sequence: Sequence) -> Found:
    """`endotsr poses`."""
    from endotsr.clips.poses.estimate import estimated

    views = Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0])
    return Found(estimated(views).poses)


def by_chain(sequence: Sequence) -> Found:
    """The first half of `endotsr poses`: flow and resection, without the bundle adjustment."""
    from endotsr.clips.poses.chain import chained
    from endotsr.clips.poses.matches import matcher_of
    from endotsr.clips.poses.views import small_views

    views = Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0])
    return Found(chained(matcher_of(small_views(views))).poses)


def by_opencv(sequence: Sequence, kind: str) -> Found:
    """`cv2.Odometry` from frame to frame. A refused frame keeps the pose of the frame before it.

    Its defaults are for a room of some metres, so the median depth becomes one metre.
    """
    import cv2

    camera, tissue = sequence.cameras[0], usable(sequence)
    depth = np.where(tissue, known_depth(sequence.depth), 0)
    unit = 1 / float(np.median(depth[depth > 0]))
    settings = cv2.OdometrySettings()
    matrix = [[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]]
    settings.setCameraMatrix(np.array(matrix, np.float32))
    settings.setMinDepth(0.05)
    settings.setMaxDepth(20.0)
    settings.setMaxDepthDiff(0.15)
    settings.setMaxTranslation(0.5)
    settings.setMaxRotation(20.0)
    algorithm = cv2.OdometryAlgoType_FAST if kind == "RGB_DEPTH" else cv2.OdometryAlgoType_COMMON
    odometry = cv2.Odometry(getattr(cv2, f"OdometryType_{kind}"), settings, algorithm)

    def frame(k: int) -> Any:
        picture = np.ascontiguousarray(sequence.images[k].transpose(1, 2, 0)[..., ::-1])
        made = cv2.OdometryFrame((depth[k] * unit).astype(np.float32), picture, (tissue[k] * 255).astype(np.uint8))
        odometry.prepareFrame(made)
        return made

    poses, before = [IDENTITY], frame(0)
    for k in range(1, sequence.count):
        now = frame(k)
        done, moved = odometry.compute(before, now)
        step = IDENTITY
        if done and moved is not None and np.isfinite(moved).all():
            step = CameraPose(np.asarray(moved)[:3, :3].astype(float), np.asarray(moved)[:3, 3] / unit)
        poses.append(compose(step, poses[-1]))
        before = now
    return Found(list(poses))


def by_pycolmap(sequence: Sequence) -> Found:
    """`endotsr poses --sfm` without depth. Raises ImportError without pycolmap."""
    import pycolmap  # type: ignore[import-not-found]  # noqa: F401  # optional: its row is left out

    from endotsr.clips.poses.structure import reconstructed

    found = reconstructed(Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0]))
    return Found([None] * sequence.count if found is None else found.poses, scaled=True)


METHODS: dict[str, Callable[[Sequence], Found]] = {
    "no motion": static,
    "`endotsr poses`": by_endotsr,
    "its first half: flow and resection": by_chain,
    "`cv2.Odometry`, RGB": lambda sequence: by_opencv(sequence, "RGB"),
    "`cv2.Odometry`, RGB and depth": lambda sequence: by_opencv(sequence, "RGB_DEPTH"),
    "`cv2.Odometry`, depth (ICP)": lambda sequence: by_opencv(sequence, "DEPTH"),
    "pycolmap": by_pycolmap,
}
