"""The moving picture of the front page and of the README: python docs/make.py book.hero [RUN]

For every frame of a run it shows the frame, the render from the same camera without the instrument, and the render from
a camera that moves left and right. Without RUN, the demo is trained first, which takes minutes.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from endotsr.cli.main import main as endotsr
from endotsr.errors import InputError
from endotsr.results.export.scene import MovingScene, open_scene
from endotsr.results.report.figures import ByteImage, bytes_image
from endotsr.results.views.cameras import fitted, path_cameras, pivot_depth_of
from endotsr.results.views.panels import GAP
from endotsr.results.views.preview import encoded
from endotsr.training.runs.sources import load_run_sequence
from endotsr.untrusted.writing import replace_file

HERO = Path(__file__).parents[2] / "results" / "hero.webp"
WIDTH = 240  # pixels of one of the three pictures
ANGLE = 8.0  # largest turn of the moving camera, degrees


def pictures(scene: MovingScene) -> list[ByteImage]:
    """One picture per frame: the frame, the render, and the render from the moving camera."""
    assert scene.folder is not None
    sequence = load_run_sequence(scene.folder, None)
    size = WIDTH, round(WIDTH * sequence.height / sequence.width)
    cameras = [fitted(camera, *size) for camera in scene.cameras]
    first = scene.render(float(sequence.times[0]), cameras[0])
    moving = path_cameras("sway", cameras, ANGLE, pivot_depth_of(first.depth, first.opacity))
    found = []
    for i, time in enumerate(map(float, sequence.times)):
        frame = Image.fromarray(bytes_image(sequence.frame(i).image)).resize(size, Image.Resampling.LANCZOS)
        row = [np.asarray(frame), *(bytes_image(scene.render(time, c).colour) for c in (cameras[i], moving[i]))]
        gap = np.full((size[1], GAP, 3), 255, np.uint8)
        found.append(np.concatenate([row[0], gap, row[1], gap, row[2]], axis=1))
    return found


def main(words: list[str]) -> None:
    """The command."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(words[0]) if words else Path(folder) / "demo"
        if not words and endotsr(["demo", "--out", str(run)]):
            sys.exit(1)
        try:
            found = encoded(pictures(open_scene(run)), "")
        except InputError as error:
            sys.exit(f"error: {error}")
    if found is None:
        sys.exit("error: too many frames for a small picture")
    replace_file(HERO, lambda temporary: temporary.write_bytes(found.moving))
    print(f"{HERO}: {found.width}x{found.height}, {len(found.moving) / 1e3:.0f} KB")
