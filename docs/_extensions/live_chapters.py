"""Chapters that run in their page: the button on the page, and the files that it reads after the press.

`docs/pages/live` says which chapters run and with which files. This extension adds a script to their pages, and writes
the files as scripts into `_static/live` of the built book. It runs nothing and needs no Pyodide.
"""

import base64
import json
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # `pages`
from pages.live.bundle import CHAPTERS, files, needs_clip
from pages.live.supply import supply
from sphinx.application import Sphinx

CLIP = "running_clip/"


def parts(chapter: str) -> list[str]:
    """Names of the scripts that a chapter reads."""
    return ["package", *(["clip"] if needs_clip(chapter) else [])]


def scripts() -> dict[str, str]:
    """The scripts by name: the modules of all chapters with the table of Pyodide's files, and the running clip."""
    table = supply()
    head = table._asdict() | {"files": {name: file._asdict() for name, file in table.files.items()}}
    found = {"package": [f"endotsrLive.supply = {json.dumps(head)};"], "clip": []}
    for path, content in {path: text for name in CHAPTERS for path, text in files(name).items()}.items():
        kept = base64.b64encode(content).decode()
        found["clip" if path.startswith(CLIP) else "package"].append(f'endotsrLive.keep("{path}", "{kept}");')
    return {name: "\n".join(lines) + "\n" for name, lines in found.items()}


def add_button(app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: Any) -> None:
    """Add the script of the button to the page of a chapter that runs."""
    folder, _, name = pagename.rpartition("/")
    if folder == "notebooks" and name in CHAPTERS:
        size = supply().size + sum(map(len, files(name).values()))
        app.add_js_file("live.js", defer="defer", **{"data-parts": " ".join(parts(name)), "data-bytes": str(size)})


def write_scripts(app: Sphinx, error: Exception | None) -> None:
    """Write the scripts of the chapters into the built book."""
    if error is None and app.builder.format == "html":
        target = Path(app.outdir) / "_static" / "live"
        target.mkdir(parents=True, exist_ok=True)
        for name, text in scripts().items():
            (target / f"{name}.js").write_text(text, encoding="utf-8", newline="\n")


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("html-page-context", add_button)
    app.connect("build-finished", write_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
