"""A finished run in the book: the build trains the demo, whose report and viewer become pages.

They are in the folder `demo` of the built book. A run of the same sources is kept. ENDOTSR_DOCS_EXECUTE=0 omits the
run, like the pictures of the notebooks.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from book_pages import source_digest
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

PAGES = ("report.html", "view.html")
SIZES = {"small": ["--scale", "0.5", "--iterations", "300"], "full": []}  # as ENDOTSR_NOTEBOOK_SIZE of the notebooks
STAMP = "sources.txt"


def train_demo(app: Sphinx, error: Exception | None) -> None:
    """Train the demo after the pages are written, unless a run of these sources exists."""
    target = Path(app.outdir) / "demo"
    size = os.environ.get("ENDOTSR_NOTEBOOK_SIZE", "small")
    stamp = f"{size} {source_digest()}\n"
    known = (target / STAMP).read_text(encoding="utf-8") if (target / STAMP).is_file() else ""
    if error is not None or app.builder.format != "html" or stamp == known:
        return
    if os.environ.get("ENDOTSR_DOCS_EXECUTE") == "0":
        return
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "endotsr", "demo", "--out", f"{folder}/demo", *SIZES.get(size, SIZES["small"])]
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode:
            raise ExtensionError(f"the demo failed: {done.stderr}")
        target.mkdir(exist_ok=True)
        for name in PAGES:
            shutil.copy(Path(folder) / "demo" / name, target / name)
    (target / STAMP).write_text(stamp, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("build-finished", train_demo)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
