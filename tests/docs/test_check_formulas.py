"""The check of formulas finds what it is made for, with the copy of MathJax that the book has."""

import shutil
from pathlib import Path

import pytest
from check_formulas import formulas, main
from page_visits import found_browser

mathjax = pytest.importorskip("mathjax")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(found_browser() is None, reason="no browser found")]
BUNDLES = Path(mathjax.__path__[0]) / "static" / "mathjax" / "es5"
BUNDLE, FONTS = "tex-chtml.js", Path("output") / "chtml" / "fonts" / "woff-v2"
EXTENSIONS = Path("input") / "tex" / "extensions"
PAGE = '<!doctype html><script defer src="{}"></script><body><p>{}</p></body>'
BOLD = r"\(\boldsymbol\omega\)"


def page(folder: Path, name: str, *tex: str) -> None:
    """A page with formulas as Sphinx writes them, and MathJax beside it."""
    for part in (FONTS, EXTENSIONS):
        shutil.copytree(BUNDLES / part, folder / "mathjax" / part, dirs_exist_ok=True)
    shutil.copy2(BUNDLES / BUNDLE, folder / "mathjax")
    body = " ".join(f'<span class="math">{formula}</span>' for formula in tex)
    (folder / name).write_text(PAGE.format(f"mathjax/{BUNDLE}", body), encoding="utf-8")


def test_good_formulas_are_counted(tmp_path, capsys):
    page(tmp_path, "a.html", r"\(x\)", BOLD)
    page(tmp_path, "b.html", r"\[\frac{a}{b}\]")
    (tmp_path / "c.html").write_text("<p>no formula</p>", encoding="utf-8")
    assert main([str(tmp_path)]) == 0
    assert capsys.readouterr().out == "0 of 3 formulas unrendered on 3 pages\n"


def test_an_extension_that_is_not_there_is_found(tmp_path, capsys):
    """MathJax loads boldsymbol from a file; without it, the whole page stays TeX."""
    page(tmp_path, "a.html", r"\(x\)", BOLD)
    (tmp_path / "mathjax" / EXTENSIONS / "boldsymbol.js").unlink()
    assert main([str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "boldsymbol.js: no such file" in said and f"a.html: left as TeX: {BOLD}" in said
    assert said.endswith("2 of 2 formulas unrendered on 1 pages\n")


@pytest.mark.parametrize(
    "tex, said",
    [(r"\(\frac{a}\)", "Missing argument"), (r"\(a \strangecommand b\)", r"unknown command \strangecommand"),
     ("x^2", "not typeset")],
)  # fmt: skip
def test_a_formula_that_is_wrong_is_found(tmp_path, tex, said):
    page(tmp_path, "a.html", r"\(x\)", tex)
    problems, unrendered, total = formulas(tmp_path, ["a.html"])
    assert (unrendered, total) == (1, 2) and said in problems[0] and len(problems) == 1


def test_a_page_without_mathjax_is_found(tmp_path):
    page(tmp_path, "a.html", r"\(x\)")
    (tmp_path / "mathjax" / BUNDLE).unlink()
    problems, unrendered, _ = formulas(tmp_path, ["a.html"])
    assert unrendered == 1 and f"{BUNDLE}: no such file" in problems[0]
    assert "MathJax did not start" in problems[1]
