"""Copies the notebooks into the book, and runs them before its pages are read, as many at once as there are cores.

The copies are docs/notebooks, which git ignores: a link in their place would be a text file in a clone on Windows.
Every build makes them anew, and removes what has no notebook any more.

MyST-NB runs a notebook when it reads its page, one after the other. Here the runs come first, and its cache, which
lives no longer than the build, hands them to the pages. A notebook that fails is not in the cache: its page runs it
again and reports the error. ENDOTSR_DOCS_CACHE=FOLDER keeps the runs for the next build, which is for work on the
layout of the pages only: a kept run does not notice that the package has changed.
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

logger = getLogger(__name__)


def copy_notebooks(app: Sphinx) -> None:
    """Make docs/notebooks equal to the notebooks; the date of an unchanged copy stays, so that its page is kept."""
    copies = DOCS / "notebooks"
    if copies.is_symlink():  # of a checkout that had a link there
        copies.unlink()
    copies.mkdir(exist_ok=True)
    sources = {file.name: file for file in NOTEBOOKS.iterdir() if file.suffix in (".py", ".md")}
    for name, file in sources.items():
        write(copies / name, file.read_text(encoding="utf-8"))
    for stale in (file for file in copies.iterdir() if file.is_file() and file.name not in sources):
        stale.unlink()


def run_notebooks(app: Sphinx, env: BuildEnvironment, names: list[str]) -> None:
    """Run those of `names` that are notebooks; the kernels that most of them call are compiled before."""
    from jupyter_cache import get_cache
    from jupyter_cache.executors import load_executor

    from endotsr.config import PAPER
    from endotsr.fitting.compile_ahead import compile_ahead

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
    """A run is as good as the kernels it called, and no longer: the next build runs what it reads."""
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
