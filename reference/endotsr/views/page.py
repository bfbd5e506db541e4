"""The viewer page: a moving scene in one HTML file that needs no server, no network and no other file.

In: a scene and, for the held-out frames beside it, its sequence. Out: the text of the page. The page draws the
Gaussians with WebGL 2 from the formulas of the specification (B2, B3, B5), sorted by depth on every picture.
"""

import base64
import html
import json
import re
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.evaluation.depth import normalised_depth
from endotsr.export.scene import MovingScene
from endotsr.fitting.model import raster_settings
from endotsr.report.figures import DEPTH_MAP, ERROR_MAP, colour_table, data_uri, depth_range, encode_transparent
from endotsr.runs.files import replace_file
from endotsr.sequences.sequence import Sequence
from endotsr.views.cameras import pivot_depth_of
from endotsr.views.panels import ERROR_SCALE
from endotsr.views.trajectories import header, key_times, packed, trajectories

MOST_KEYS = 128
KEYS = 32  # key times unless more or fewer are asked for
RUN_PAGE = "view.html"  # in a run folder
TEMPLATE, SCRIPT = "viewer.html", "viewer.js"


def check_page(file: Path, keys: int) -> None:
    """Raises InputError if this is no name of a page, or no number of key times."""
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{file}: not a page; allowed: a name that ends in .html")
    if not 2 <= keys <= MOST_KEYS:
        raise InputError(f"export: --keys {keys} is not allowed; allowed: an integer from 2 to {MOST_KEYS}")


def write_page(file: Path, scene: MovingScene, title: str, keys: int, sequence: Sequence | None = None) -> int:
    """Write the page, which appears whole or not at all; returns its bytes."""
    content = page(scene, title, keys, sequence).encode()
    replace_file(file, lambda temporary: temporary.write_bytes(content))
    return len(content)


def write_run_page(folder: Path, scene: MovingScene, sequence: Sequence | None) -> None:
    """Write the page of a run into its folder, or remove that of an earlier evaluation if `sequence` is None."""
    if sequence is None:
        (folder / RUN_PAGE).unlink(missing_ok=True)
    else:
        write_page(folder / RUN_PAGE, scene, folder.absolute().name, KEYS, sequence)


def page(scene: MovingScene, title: str, keys: int, sequence: Sequence | None = None) -> str:
    """The text of the page.

    title      text, shown as the heading
    keys       largest number of key times
    sequence   the frames; without it the page has no held-out frames and no error
    """
    found = trajectories(scene, key_times(scene, keys))
    about = header(found) | _about(scene) | {"held_out": _held_out(sequence) if sequence else []}
    folder = resources.files("endotsr.views")
    text = (folder / TEMPLATE).read_text(encoding="utf-8")
    parts = {
        "@TITLE@": html.escape(title),
        "@SCRIPT@": (folder / SCRIPT).read_text(encoding="utf-8"),
        "@ABOUT@": json.dumps(about).replace("<", "\\u003c"),
        "@DATA@": base64.b64encode(packed(found)).decode("ascii"),
    }
    return re.sub("|".join(parts), lambda mark: parts[mark[0]], text)


def _about(scene: MovingScene) -> dict[str, Any]:
    """Cameras, rules of the rasteriser, colours, and the depths that they span."""
    record, settings = scene.record, raster_settings(scene.model.config)
    cameras = scene.cameras
    out = scene.render(record.times[0], cameras[0])
    low, high = depth_range(normalised_depth(out))
    shown = cameras[:1] if record.static_camera else cameras
    return {
        "unit": record.unit,
        "duration": record.duration,
        "frames": {"names": record.names, "times": record.times},
        "cameras": [
            [*np.ravel(c.rotation).tolist(), *np.ravel(c.translation).tolist(), c.fx, c.fy, c.cx, c.cy] for c in shown
        ],
        "width": cameras[0].width,
        "height": cameras[0].height,
        "pivot_depth": pivot_depth_of(out.depth, out.opacity),
        "depth_range": [low, high],
        "error_scale": ERROR_SCALE,
        "raster": {
            "near": settings.near,
            "alpha_cutoff": max(settings.alpha_cutoff, 1 / 4096),
            "alpha_max": settings.alpha_max,
            "jacobian_clamp": settings.jacobian_clamp,
            "low_pass": settings.low_pass,
        },
        "maps": {name: colour_table(name).ravel().tolist() for name in (DEPTH_MAP, ERROR_MAP)},
    }


def _held_out(sequence: Sequence) -> list[dict[str, Any]]:
    """The held-out frames as pictures; an excluded pixel is transparent."""
    found = []
    for i in map(int, sequence.test_index):
        picture = np.dstack([sequence.images[i].transpose(1, 2, 0), sequence.masks[i] * np.uint8(255)])
        uri = data_uri(encode_transparent(picture), "png")
        found.append({"name": sequence.names[i], "time": float(sequence.times[i]), "picture": uri})
    return found
