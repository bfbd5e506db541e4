"""The viewer page: a moving scene in one HTML file that needs no server, no network and no other file.

In: a scene and, to show held-out frames, its sequence. Out: the text of the page. It renders the Gaussians with WebGL 2
by the formulas of the specification (B2, B3, B5), sorted by depth in every picture.
"""

import base64
import html
import json
import re
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.record import SequenceRecord
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.results.evaluation.depth import normalised_depth
from endotsr.results.export.scene import MovingScene
from endotsr.results.report.figures import DEPTH_MAP, ERROR_MAP, colour_table, data_uri, depth_range, encode
from endotsr.results.views.cameras import pivot_depth_of
from endotsr.results.views.panels import ERROR_SCALE
from endotsr.results.views.trajectories import Trajectories, header, key_times, packed, trajectories
from endotsr.training.fitting.model import raster_settings
from endotsr.training.runs.files import PAGE_ENDINGS
from endotsr.untrusted.writing import replace_file

MOST_KEYS = 128
SECONDS = 4  # playing time of a scene of unknown duration
KEYS = 32  # default number of key times
RUN_PAGE = "view.html"  # in a run folder
TEMPLATE, SCRIPT = "viewer.html", "viewer.js"


def check_page(file: Path, keys: int) -> None:
    """Raises InputError for a wrong extension or an invalid number of key times."""
    if file.suffix.lower() not in PAGE_ENDINGS:
        raise InputError(f"{file}: not a page; use a name that ends in .html")
    if not 2 <= keys <= MOST_KEYS:
        raise InputError(f"export: --keys {keys} is not allowed; use an integer from 2 to {MOST_KEYS}")


def write_page(file: Path, scene: MovingScene, title: str, keys: int, sequence: Sequence | None = None) -> int:
    """Write the page atomically; returns its size in bytes."""
    content = page(scene, title, keys, sequence).encode()
    replace_file(file, lambda temporary: temporary.write_bytes(content))
    return len(content)


def write_run_page(folder: Path, scene: MovingScene, sequence: Sequence | None) -> None:
    """Write the page of a run into its folder; if `sequence` is None, remove an earlier page."""
    if sequence is None:
        (folder / RUN_PAGE).unlink(missing_ok=True)
    else:
        write_page(folder / RUN_PAGE, scene, folder.absolute().name, KEYS, sequence)


def page(scene: MovingScene, title: str, keys: int, sequence: Sequence | None = None) -> str:
    """The text of the page.

    title      heading
    keys       maximum number of key times
    sequence   the frames; without it the page shows no held-out frames and no error
    """
    found = trajectories(scene, key_times(scene, keys))
    low, high, pivot = depths_shown(scene)
    frames = about_frames(scene.record, range(scene.record.count))
    about = header(found) | frames | about_pictures(scene, pivot) | {"depth_range": [low, high]}
    about |= {"cameras": camera_numbers(scene), "seconds": SECONDS}
    held_out = [frame._asdict() for frame in held_out_frames(sequence)] if sequence else []
    return page_text(title, about | {"held_out": held_out}, encoded(found))


def encoded(found: Trajectories) -> str:
    """The packed trajectories as base64 text."""
    return base64.b64encode(packed(found)).decode("ascii")


def page_text(title: str, about: dict[str, object], data: str) -> str:
    """The template filled with the heading, the script, its input `about`, and the encoded Gaussians."""
    folder = resources.files("endotsr.results.views")
    text = (folder / TEMPLATE).read_text(encoding="utf-8")
    parts = {
        "@TITLE@": html.escape(title),
        "@SCRIPT@": (folder / SCRIPT).read_text(encoding="utf-8"),
        "@ABOUT@": json.dumps(about).replace("<", "\\u003c"),
        "@DATA@": data,
    }
    return re.sub("|".join(parts), lambda mark: parts[mark[0]], text)


def about_frames(record: SequenceRecord, numbers: Iterable[int]) -> dict[str, object]:
    """Names, times and numbers of the frames, the unit of length, and the seconds from time 0 to 1 (0 = unknown)."""
    frames = {"names": record.names, "times": record.times, "numbers": list(numbers)}
    return {"unit": record.unit, "duration": record.duration, "frames": frames}


def depths_shown(scene: MovingScene) -> tuple[float, float, float]:
    """Ends of the depth colours, from the first picture, and the pivot depth; scene units."""
    out = scene.render(scene.record.times[0], scene.cameras[0])
    return *depth_range(normalised_depth(out)), pivot_depth_of(out.depth, out.opacity)


def camera_numbers(scene: MovingScene) -> list[list[float]]:
    """Rotation, translation, focal lengths and centre of each frame's camera; one row for a static camera."""
    shown = scene.cameras[:1] if scene.record.static_camera else scene.cameras
    return [[*np.ravel(c.rotation).tolist(), *np.ravel(c.translation).tolist(), c.fx, c.fy, c.cx, c.cy] for c in shown]


def about_pictures(scene: MovingScene, pivot_depth: float) -> dict[str, object]:
    """Picture size, rasteriser settings and colour maps."""
    settings, camera = raster_settings(scene.model.config), scene.cameras[0]
    return {
        "width": camera.width,
        "height": camera.height,
        "pivot_depth": pivot_depth,
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


class HeldOut(NamedTuple):
    """A held-out frame of the page."""

    name: str
    time: float
    picture: str  # data URI; excluded pixels are transparent


def held_out_frames(sequence: Sequence) -> list[HeldOut]:
    """The held-out frames as pictures."""
    found = []
    for i in map(int, sequence.test_index):
        picture = np.dstack([sequence.images[i].transpose(1, 2, 0), sequence.masks[i] * np.uint8(255)])
        uri = data_uri(encode(picture), "png")
        found.append(HeldOut(sequence.names[i], float(sequence.times[i]), uri))
    return found
