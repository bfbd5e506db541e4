"""Recordings with depth of another program: true lengths, and what is no length in millimetres."""

import numpy as np
from made_videos import write

from endotsr.clips.opencv.png import write_png

WIDTH, HEIGHT, FRAMES = 128, 96, 6
CAMERA = ["--camera", "100", "100", "64", "48"]
BASELINE = 5.0


def true_depth(i):
    """A wall of 40 to 70 mm that leans to the right and moves."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return 40 + 22 * x / WIDTH + 5 * y / HEIGHT + 2 * np.sin(y / 9 + i)


def lit_picture(i):
    """Tissue under the light of the scope, which falls with the square of the depth; a texture beside it."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    light = (40 / true_depth(i)) ** 2 * (1 + 0.1 * np.sin(x / 3 + 0.5 * i) * np.cos(y / 4))
    return np.clip(light[..., None] * np.array([200, 90, 70]), 0, 255).astype(np.uint8)


def recording(folder, values, name="depth", kind="npy"):
    """A clip.mp4 and a folder of depth files, one a frame."""
    write(folder / "clip.mp4", [lit_picture(i) for i in range(FRAMES)], options={"crf": "18"})
    (folder / name).mkdir()
    for i in range(FRAMES):
        plane = values(i)
        file = folder / name / f"{i:06d}.{kind}"
        np.save(file, plane.astype(np.float32)) if kind == "npy" else write_png(file, plane)
    return ["prepare", str(folder / "clip.mp4"), "--out", str(folder / "o"), *CAMERA, "--depth", str(folder / name)]


def disparity(i):
    return 100 * BASELINE / true_depth(i)


def scaled(values, top, kind):
    return (values / values.max() * top).astype(kind)


WRONG = {  # what the files hold: values, name of the folder, ending, what the message says
    "disparity in pixels": (lambda i: 4 * disparity(i), "depth", "npy", "increases with depth (rank correlation"),
    "relative inverse depth": (lambda i: 1800 / true_depth(i) - 3, "depth", "npy", "increases with depth (rank corr"),
    "disparity by its name": (lambda i: 4 * disparity(i), "disparity_raft", "npy", "indicates a disparity"),
    "a network by its name": (lambda i: true_depth(i), "depth_anything_v2", "npy", "indicates a disparity or a rel"),
    "stretched to 8 bits": (lambda i: scaled(true_depth(i), 255, np.uint8), "depth", "png", "of every frame is 255"),
    "stretched to 16 bits": (lambda i: scaled(true_depth(i), 65535, np.uint16), "depth", "png", "frame is 65535"),
    "stretched to 0 to 1": (lambda i: scaled(disparity(i), 1.0, np.float32), "depth", "npy", "of every frame is 1"),
    "disparity times 256": (lambda i: (disparity(i) * 256).astype(np.uint16), "depth", "png", "the median depth is"),
    "metres": (lambda i: true_depth(i) / 1000, "depth", "npy", "like metres; state another unit with --depth-unit"),
}
