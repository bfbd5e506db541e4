"""Sphinx configuration. Build: sphinx-build -W -j auto -b html docs docs/_build/html (extra `docs`)."""

import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_extensions"), str(HERE.parent / "golden")]

project = "endotsr"
author = "the endotsr authors"
copyright = "the endotsr authors, Apache-2.0"  # the name Sphinx gives to this setting

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
# Those of docs/_extensions.
extensions += ["paper_equations", "book_pages", "book_links", "api_pages", "notebook_runs"]
extensions += ["notebook_cells", "unbroken_units", "demo_run", "live_chapters"]
exclude_patterns = ["_build", "_extensions", "conf.py", "make.py", "pages/**", "results/**.py"]  # makers of other pages
exclude_patterns += ["notebooks/running_clip/**"]  # a module of the chapters, no page
source_suffix = {".md": "myst-nb", ".py": "myst-nb", ".rst": "restructuredtext"}

# The types of the package's arrays say little; shapes and units stand in the docstrings.
autodoc_typehints = "none"
add_module_names = False

# Every reference inside the project must resolve.
nitpicky = True

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "fieldlist"]
myst_heading_anchors = 3

# The notebooks (copied to docs/notebooks) are pages, and run when the book is built: at the small size of the
# tests, or with ENDOTSR_NOTEBOOK_SIZE=full at the size of the text. ENDOTSR_DOCS_EXECUTE=0 leaves the pictures out.
os.environ.setdefault("ENDOTSR_NOTEBOOK_SIZE", "small")
os.environ.pop("MPLBACKEND", None)  # with a backend from outside, the pages of the notebooks have no figure
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = "off" if os.environ.get("ENDOTSR_DOCS_EXECUTE") == "0" else "cache"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 1200

# The label is the number: `eq-b5` is displayed as (B5), see _extensions/paper_equations.py.
numfig = True
math_numfig = False

html_theme = "sphinx_book_theme"
html_title = "endotsr"
html_static_path = ["_static"]
html_css_files = ["endotsr.css"]
html_search_scorer = str(HERE / "_static" / "scorer.js")
html_js_files = [("widgets.js", {"defer": "defer"})]
# The whole tree of pages beside every page would take most of the time of a build.
html_theme_options = {"show_toc_level": 2, "home_page_in_toc": True, "collapse_navigation": True}
html_theme_options |= {"navbar_persistent": []}  # one search, in the sidebar
html_sidebars = {"_modules/**": [], "search": ["navbar-logo.html", "sbt-sidebar-nav.html"]}  # one search a page
html_show_sphinx = False

MATHJAX_CDN = "https://cdn.jsdelivr.net/npm/mathjax@3/es5/tex-chtml.js"


def _copy_mathjax() -> str:
    """Copy MathJax from its wheel (extra `docs`) into _static, so that the pages need no network."""
    spec = find_spec("mathjax")
    if spec is None or not spec.submodule_search_locations:
        return MATHJAX_CDN
    source = Path(spec.submodule_search_locations[0]) / "static" / "mathjax" / "es5"
    if not (source / "tex-chtml.js").is_file():
        return MATHJAX_CDN
    target = HERE / "_static" / "mathjax"
    # MathJax loads fonts and the extensions of less common commands, such as boldsymbol, when a page needs them.
    for folder in (Path("output") / "chtml" / "fonts" / "woff-v2", Path("input") / "tex" / "extensions"):
        shutil.copytree(source / folder, target / folder, dirs_exist_ok=True)
    shutil.copy2(source / "tex-chtml.js", target / "tex-chtml.js")
    return "mathjax/tex-chtml.js"


mathjax_path = _copy_mathjax()
