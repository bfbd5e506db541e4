"""The animated preview of a report: the scene over all times, small enough to embed.

In: a scene. Out: an animated WebP of at most PREVIEW_BYTES: on the left from the observed camera, on the right from a
camera that moves left and right.
"""

import io
from typing import Any

import numpy as np

from endotsr.results.export.scene import MovingScene
from endotsr.results.report.data import Preview
from endotsr.results.report.figures import ByteImage, bytes_image
from endotsr.results.views.cameras import fitted, path_cameras, pivot_depth_of
from endotsr.results.views.panels import GAP

PREVIEW_BYTES = 500_000  # maximum size; base64 adds 33 % in the page
PREVIEW_WIDTH = 240  # width of each of the two pictures, pixels
PREVIEW_COUNT = 24  # maximum number of pictures
MILLISECONDS = 120  # per picture
ANGLE = 8.0  # largest rotation of the moving camera, degrees
QUALITIES = (80, 60, 40, 20)  # of WebP, tried in this order until the size is within the limit
WORDS = "The scene over all times: from the observed camera, and from a camera that moves left and right."


def preview(scene: MovingScene) -> Preview | None:
    """The preview of a scene; None if even the lowest quality is larger than PREVIEW_BYTES."""
    return encoded(preview_pictures(scene), WORDS)


def encoded(found: list[ByteImage], words: str) -> Preview | None:
    """Pictures of one size as a preview; None if even the lowest quality is larger than PREVIEW_BYTES.

    words   caption
    """
    from PIL import Image

    pictures = [Image.fromarray(picture) for picture in found]
    for quality in QUALITIES:
        content = _animated(pictures, quality)
        if len(content) <= PREVIEW_BYTES:
            return Preview(content, _animated(pictures[:1], quality), *pictures[0].size, words)
    return None


def preview_pictures(scene: MovingScene) -> list[ByteImage]:
    """The pictures of the preview, (H, W, 3) uint8, with two views of the same time next to each other."""
    times, cameras = np.asarray(scene.record.times, np.float64), scene.cameras
    count = min(PREVIEW_COUNT, max(len(times), 2))
    wanted = np.linspace(0, float(times.max()), count)
    near = [cameras[int(np.abs(times - time).argmin())] for time in wanted]
    height = max(1, round(PREVIEW_WIDTH * near[0].height / near[0].width))
    observed = [fitted(camera, PREVIEW_WIDTH, height) for camera in near]
    first = scene.render(float(wanted[0]), observed[0])
    moving = path_cameras("sway", observed, ANGLE, pivot_depth_of(first.depth, first.opacity))
    found, gap = [], np.full((height, GAP, 3), 255, np.uint8)
    for time, pair in zip(wanted, zip(observed, moving)):
        left, right = (bytes_image(scene.render(float(time), camera).colour) for camera in pair)
        found.append(np.concatenate([left, gap, right], axis=1))
    return found


def _animated(pictures: list[Any], quality: int) -> bytes:
    buffer = io.BytesIO()
    options = {"format": "WEBP", "quality": quality, "method": 4}
    if len(pictures) > 1:
        options |= {"save_all": True, "append_images": pictures[1:], "duration": MILLISECONDS, "loop": 0}
    pictures[0].save(buffer, **options)
    return buffer.getvalue()
