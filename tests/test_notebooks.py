"""The notebooks run, stay text, print the displays of the specification and cover the paper's equations."""

import ast
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from pages.book import definitions

import notebook_signs

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
SPECIFICATION = ROOT / "docs" / "specification"
DISPLAY = re.compile(r"^\$\$\n(.*?)\n\$\$(?: \(eq-([\w-]+)\))?$", flags=re.MULTILINE | re.DOTALL)
TRANSCRIBED = ("03_simulated_scene", "14_full_sequence", "15_hard_cases", "16_tradeoff", "17_effects")
"""Notebooks of what no equation of the definition says; all others show the definition."""
WITHOUT_DERIVATIVE = {"00_why", "16_tradeoff", "17_effects"}  # measure what the others derive
COLUMNS = 96  # of code on a page of the book
LINK = re.compile(r"\{eq\}`eq-([\w-]+)`")


def prose(file: Path) -> str:
    """The Markdown cells as text, comment signs removed."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines if line.startswith("#"))


def displays(text: str) -> list[tuple[str, str]]:
    """(content, label or "") of every display."""
    return [(content, label or "") for content, label in DISPLAY.findall(text)]


def in_specification() -> dict[str, str]:
    text = "\n\n".join(page.read_text(encoding="utf-8") for page in sorted(SPECIFICATION.glob("*.md")))
    return dict(displays(text))


@pytest.fixture(autouse=True)
def _drawn_to_nowhere(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("ENDOTSR_NOTEBOOK_SIZE", os.environ.get("ENDOTSR_NOTEBOOK_SIZE", "small"))
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    yield
    plt.close("all")


TRAIN = ("00_why", "14_full_sequence", "18_between", "19_tracked_motion", "20_first_look", "21_one_seam")
SLOW = dict.fromkeys(TRAIN, pytest.mark.slow)


@pytest.mark.parametrize(
    "file", [pytest.param(file, marks=SLOW.get(file.stem, ()), id=file.stem) for file in NOTEBOOKS]
)
def test_notebook_runs(file, capsys):
    runpy.run_path(str(file), run_name="__main__")


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebook_is_one_for_jupyter(file):
    jupytext = pytest.importorskip("jupytext")
    book = jupytext.read(file, fmt="py:percent")
    text = jupytext.writes(book, fmt="ipynb")
    assert '"nbformat": 4' in text
    assert book.metadata["kernelspec"]["name"] == "python3"
    answers = [cell for cell in book.cells if "hide-cell" in cell.metadata.get("tags", [])]
    assert len(answers) == 1, "one exercise with a hidden answer"
    assert all(cell.metadata["jupyter"]["source_hidden"] for cell in answers)
    tagged = any("transcription" in cell.metadata.get("tags", []) for cell in book.cells)
    assert tagged or definitions.named(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebook_opens_with_prose_and_folds_its_imports(file):
    parts = re.split(r"^# %%(.*)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    heads, bodies = parts[0::2], parts[1::2]
    assert "[markdown]" in heads[0]
    assert "hide-input" in heads[1] and '"code_prompt_show": "Imports"' in heads[1]
    body = ast.parse(bodies[1]).body
    assert body and all(isinstance(node, ast.Import | ast.ImportFrom) for node in body), "imports and nothing else"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_code_stands_in_the_column_of_a_page(file):
    parts = re.split(r"^# %%(.*)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    code = [body for head, body in zip(parts[0::2], parts[1::2]) if "[markdown]" not in head]
    wide = [line for body in code for line in body.splitlines() if len(line) > COLUMNS]
    assert not wide, f"more than {COLUMNS} characters"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebook_has_all_its_parts(file):
    text = file.read_text(encoding="utf-8")
    assert "plt.show()" in text, "a picture"
    assert "\n# ## Exercise\n" in text
    assert re.search(r"^\s*(?:assert |np\.testing\.assert)", text, re.MULTILINE), "an assertion"
    if file.stem not in WITHOUT_DERIVATIVE:
        assert "\n# ## The reverse pass" in text, "its derivation, or why there is none"
        assert re.search(r"print\(table\(", text), "the table of the gradient check"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_an_equation_is_shown_as_its_definition_and_not_written_again(file):
    if file.stem in TRANSCRIBED:
        return
    cells = [body for formula, body in notebook_signs.code_cells(file) if formula]
    assert definitions.named(file.read_text(encoding="utf-8"))
    assert not [body for body in cells if "def " in body], "a second text of an equation"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_the_definition_in_a_chapter_is_that_of_the_package(file):
    text = file.read_text(encoding="utf-8")
    assert text.count("<!-- definition: ") == len(definitions.named(text)), "a marker without its block"
    assert definitions.written(text) == text, "run: python docs/make.py book.definitions"
    assert "getsource" not in text


def test_a_changed_definition_in_a_chapter_is_noticed():
    text = next(file for file in NOTEBOOKS if file.stem == "04_deformation").read_text(encoding="utf-8")
    changed = text.replace("#     delta = t - centre\n", "#     delta = t + centre\n")
    assert changed != text == definitions.written(changed)


@pytest.mark.parametrize("name", [name for name in TRANSCRIBED if name != "14_full_sequence"])
def test_a_flipped_sign_of_a_transcription_is_noticed(name):
    """One sign a notebook; all of them: notebook_signs.py. Those of the definition: definition/signs.py."""
    noticed, line = notebook_signs.a_flip_is_noticed(ROOT / "notebooks" / f"{name}.py")
    assert noticed, f"with the sign flipped, nothing failed: {line}"


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_flipped_sign_of_a_kernel_is_noticed():
    """A few signs of the package; all of them: python tests/kernel_signs.py."""
    command = [sys.executable, str(ROOT / "tests" / "kernel_signs.py"), "--sample", "3"]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert answer.stdout.count("noticed ") == 3


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_displays_are_those_of_the_specification(file):
    """Every display is printed as the specification prints it, and every equation of the title is displayed."""
    known = in_specification()
    shown = displays(prose(file))
    for content, _ in shown:
        assert content in known, f"{file.name}: no page of docs/specification prints this; copy its display:\n{content}"
    announced = LINK.findall(prose(file).split("\n## ")[0])
    missing = set(announced) - {known[content] for content, _ in shown}
    assert announced and not missing, f"announced, but not displayed: {sorted(missing)}"


@pytest.mark.parametrize("label", list("1234567"))
def test_every_equation_of_the_paper_has_a_notebook(label):
    content = {label: content for content, label in in_specification().items()}[label]
    assert [file.name for file in NOTEBOOKS if content in prose(file)], f"equation ({label}) is displayed nowhere"


def test_the_table_of_contents_names_every_notebook_in_order():
    lines = (ROOT / "notebooks" / "index.md").read_text(encoding="utf-8").splitlines()
    names = [file.stem for file in NOTEBOOKS]
    assert [line for line in lines if line in names] == names


def test_no_stored_notebooks():
    assert not list((ROOT / "notebooks").rglob("*.ipynb")), "notebooks are kept as py:percent text only"
