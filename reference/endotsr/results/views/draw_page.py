"""The drawing page: masks of key frames drawn by hand, in one HTML file that needs no server and no other file.

In: a `DrawnClip`. Out: the text of the page, which saves the file that `drawn_masks` reads.
"""

import html
import json
import re
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from endotsr.clips.masks.drawing import DrawnClip, DrawnFrame
from endotsr.clips.masks.drawn_masks import FORMAT
from endotsr.clips.masks.mask_shapes import MaskShape
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.report.figures import data_uri, encode
from endotsr.untrusted.writing import replace_text

TEMPLATE, SCRIPT = "draw.html", "draw.js"


def check_draw_page(file: Path) -> None:
    """Raises InputError for a name that is no page."""
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{file}: not a page; use a name that ends in .html")


def write_draw_page(file: Path, drawing: DrawnClip, title: str, command: str) -> None:
    """Write the page atomically. Raises OSError naming the file."""
    replace_text(file, draw_page(drawing, title, command))


def draw_page(drawing: DrawnClip, title: str, command: str) -> str:
    """The text of the page.

    title     heading
    command   the command that reads the file of the page
    """
    about = {
        "format": FORMAT,
        "count": drawing.count,
        "width": drawing.width,
        "height": drawing.height,
        "grid": {"step": drawing.step, "columns": drawing.columns},
        "never": _plain(drawing.never),
        "command": command,
        "frames": [_about_frame(frame) for frame in drawing.frames],
    }
    folder = resources.files("endotsr.results.views")
    parts = {
        "@TITLE@": html.escape(title),
        "@SCRIPT@": (folder / SCRIPT).read_text(encoding="utf-8"),
        "@ABOUT@": json.dumps(about).replace("<", "\\u003c"),
    }
    text = (folder / TEMPLATE).read_text(encoding="utf-8")
    return re.sub("|".join(parts), lambda mark: parts[mark[0]], text)


def _about_frame(shown: DrawnFrame) -> dict[str, Any]:
    draft = shown.draft and {"origin": shown.draft.origin, "shapes": _plain(shown.draft.shapes)}
    return {
        "frame": shown.frame,
        "name": shown.name,
        "picture": data_uri(encode(shown.picture, "webp"), "webp"),
        "shapes": _plain(shown.shapes),
        "key": shown.key,
        "draft": draft,
        "ahead": _field(shown.ahead),
        "back": _field(shown.back),
    }


def _plain(shapes: list[MaskShape]) -> list[dict[str, Any]]:
    return msgspec.to_builtins(shapes)


def _field(displacement: FloatArray | None) -> dict[str, list[float]] | None:
    """Displacements (2, m) to a tenth of a pixel."""
    return None if displacement is None else {k: v.round(1).tolist() for k, v in zip("xy", displacement)}
