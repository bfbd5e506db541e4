"""A finished run in the book: the build trains the demo, whose report and viewer become pages.

They are in the folder `demo` of the built book. The training runs while the pages are written. A run of the same
sources is kept. ENDOTSR_DOCS_EXECUTE=0 omits the run, like the pictures of the notebooks.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from book_pages import source_digest
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError

PAGES = ("report.html", "view.html")
SIZES = {"small": ["--scale", "0.5", "--iterations", "300"], "full": []}  # as ENDOTSR_NOTEBOOK_SIZE of the notebooks
STAMP = "sources.txt"


class DemoRun:
    """The training of one build."""

    def __init__(self) -> None:
        self._size = os.environ.get("ENDOTSR_NOTEBOOK_SIZE", "small")
        self._stamp = f"{self._size} {source_digest()}\n"
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._training: subprocess.Popen[str] | None = None

    def begin(self, app: Sphinx, env: BuildEnvironment) -> None:
        """Begin the training after the pages are read, unless a run of these sources exists."""
        stamp = Path(app.outdir) / "demo" / STAMP
        known = stamp.is_file() and stamp.read_text(encoding="utf-8") == self._stamp
        if known or app.builder.format != "html" or os.environ.get("ENDOTSR_DOCS_EXECUTE") == "0":
            return
        self._folder = tempfile.TemporaryDirectory()
        out, size = f"{self._folder.name}/demo", SIZES.get(self._size, SIZES["small"])
        words = [sys.executable, "-m", "endotsr", "demo", "--out", out, *size]
        self._training = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def finish(self, app: Sphinx, error: Exception | None) -> None:
        """Wait for the training and keep its pages; stop it if the build failed."""
        if self._folder is None or self._training is None:
            return
        with self._folder as folder:
            if error is not None:
                self._training.kill()
            _, said = self._training.communicate()
            if error is not None:
                return
            if self._training.returncode:
                raise ExtensionError(f"the demo failed: {said}")
            target = Path(app.outdir) / "demo"
            target.mkdir(exist_ok=True)
            for name in PAGES:
                shutil.copy(Path(folder) / "demo" / name, target / name)
        (target / STAMP).write_text(self._stamp, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    demo = DemoRun()
    app.connect("env-updated", demo.begin)
    app.connect("build-finished", demo.finish)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
