"""One page of the book as HTML, without the others: python docs/make.py book.preview PAGE [FOLDER]

    python docs/make.py book.preview b06_masked_l1          a page of text, about five seconds
    python docs/make.py book.preview 02_colour_residual     a chapter, executed at the small size

PAGE is the name of a page of `docs` or of a notebook, or its path.

The page has the style, the formulas and the figures of the book. Links to other pages and to the API stay plain text.
FOLDER is docs/_build/preview by default. With ENDOTSR_DOCS_EXECUTE=0 a chapter is shown without its outputs.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parents[2]
ROOT = DOCS.parent
# What needs the other pages: the generated pages, the API, the links between pages, and the run of every notebook.
LEFT_OUT = {"book_pages", "book_links", "api_pages", "notebook_runs", "demo_run", "sphinx.ext.viewcode"}
CONFIGURATION = """
from pathlib import Path
__file__ = {conf!r}
exec(compile(Path(__file__).read_text(encoding="utf-8"), __file__, "exec"))
extensions = [name for name in extensions if name not in {left_out!r}]
include_patterns, root_doc, exclude_patterns, nitpicky = [{page!r}], {name!r}, [], False
html_static_path = [str(HERE / path) for path in html_static_path]
nb_execution_mode, suppress_warnings = {mode!r}, ["myst.xref_missing", "ref", "toc", "app.add_directive"]
"""


def inside_docs(page: Path) -> Path:
    """The page below `docs`; a notebook is copied there, as the build of the book does."""
    if page.is_relative_to(DOCS):
        return page
    copy = DOCS / "notebooks" / page.name
    copy.parent.mkdir(exist_ok=True)
    shutil.copyfile(page, copy)
    shutil.copyfile(page.parent / "matplotlibrc", copy.parent / "matplotlibrc")
    shutil.copytree(page.parent / "running_clip", copy.parent / "running_clip", dirs_exist_ok=True)
    return copy


def page_of(name: str) -> Path:
    """The file of a page, by its path or by its name without folder and ending."""
    if Path(name).is_file():
        return Path(name).resolve()
    below = [*DOCS.glob("*.md"), *DOCS.glob("[a-z]*/*.md"), *(ROOT / "notebooks").glob("*.py")]
    found = [file for file in below if file.stem == Path(name).stem]
    if len(found) != 1:
        sys.exit(f"{name}: {len(found)} pages have this name: {', '.join(map(str, found)) or 'use the path of a page'}")
    return found[0]


def main(words: list[str]) -> None:
    """Build the page and print its path. Exits with the code of sphinx-build."""
    if not 1 <= len(words) <= 2:
        sys.exit(__doc__)
    page = inside_docs(page_of(words[0]))
    out = Path(words[1] if len(words) > 1 else DOCS / "_build" / "preview").resolve()
    relative = page.relative_to(DOCS)
    text = CONFIGURATION.format(
        conf=str(DOCS / "conf.py"),
        left_out=LEFT_OUT,
        page=relative.as_posix(),
        name=relative.with_suffix("").as_posix(),
        mode="force" if page.suffix == ".py" and os.environ.get("ENDOTSR_DOCS_EXECUTE") != "0" else "off",
    )
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "conf.py").write_text(text, encoding="utf-8")
        command = [sys.executable, "-m", "sphinx", "-q", "-b", "html", "-c", folder, "-d", f"{folder}/trees"]
        code = subprocess.run([*command, str(DOCS), str(out)], check=False, cwd=ROOT).returncode
    if code:
        sys.exit(code)
    print(out / relative.with_suffix(".html"))
