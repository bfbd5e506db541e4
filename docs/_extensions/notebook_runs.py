"""Copies the notebooks into the book, and runs them before its pages are read, one per core at a time.

The copies are in docs/notebooks, which git ignores; a symbolic link would be a text file in a clone on Windows. Every
build updates the copies and removes copies without a notebook.

MyST-NB alone would run the notebooks one after the other when it reads their pages. Here they run in advance, and its
cache, which is deleted after the build, passes the results to the pages. A failed notebook is not in the cache: its
page reruns it and reports the error. ENDOTSR_DOCS_CACHE=FOLDER keeps the runs for the next build. Use it only for work
on the layout of the pages, because kept runs do not reflect changes of the package.
"""

import logging
import os
import shutil
import tempfile
from pathlib import Path

from book_pages import DOCS, write
from package_names import NOTEBOOKS
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.logging import getLogger

RUNNING_CLIP = "running_clip"
logger = getLogger(__name__)


def copy_notebooks(app: Sphinx) -> None:
    """Make docs/notebooks equal to the notebooks; unchanged copies keep their date, so their pages are not reread."""
    copies = DOCS / "notebooks"
    if copies.is_symlink():  # of an older checkout
        copies.unlink()
    copies.mkdir(exist_ok=True)
    sources = {
        file.name: file for file in NOTEBOOKS.iterdir() if file.suffix in (".py", ".md") or file.name == "matplotlibrc"
    }
    for name, file in sources.items():
        write(copies / name, file.read_text(encoding="utf-8"))
    for stale in (file for file in copies.iterdir() if file.is_file() and file.name not in sources):
        stale.unlink()
    if (NOTEBOOKS / RUNNING_CLIP).is_dir():  # imported by chapters, which run in the folder of the copies
        shutil.copytree(NOTEBOOKS / RUNNING_CLIP, copies / RUNNING_CLIP, dirs_exist_ok=True)


def run_notebooks(app: Sphinx, env: BuildEnvironment, names: list[str]) -> None:
    """Run the notebooks among `names`, after compiling the kernels that most of them call."""
    from jupyter_cache import get_cache
    from jupyter_cache.executors import load_executor

    from endotsr.config import PAPER
    from endotsr.training.fitting.compile_ahead import compile_ahead

    paths = [path for path in (Path(env.doc2path(name)) for name in names) if path.suffix == ".py"]
    if len(paths) < 2 or app.config.nb_execution_mode != "cache":
        return
    compile_ahead(PAPER)
    cache = get_cache(app.config.nb_execution_cache_path)
    for path in paths:
        cache.add_nb_to_project(str(path), read_data={"name": "jupytext", "type": "plugin"})
    runs = load_executor("local-parallel", cache, logging.getLogger(__name__))
    found = runs.run_and_cache(timeout=app.config.nb_execution_timeout)
    logger.info("notebooks: %d ran, %d failed", len(found.succeeded), len(found.excepted) + len(found.errored))


def forget_runs(app: Sphinx, error: Exception | None) -> None:
    """Delete the runs: they are valid only for the kernels of this build."""
    if not os.environ.get("ENDOTSR_DOCS_CACHE"):
        shutil.rmtree(app.config.nb_execution_cache_path, ignore_errors=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    kept = os.environ.get("ENDOTSR_DOCS_CACHE")
    app.config.nb_execution_cache_path = kept or tempfile.mkdtemp(prefix="endotsr-notebooks-")
    app.connect("builder-inited", copy_notebooks)
    app.connect("env-before-read-docs", run_notebooks)
    app.connect("build-finished", forget_runs)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
