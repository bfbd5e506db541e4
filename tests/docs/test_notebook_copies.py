"""The notebooks in the book are those of the folder, at every build."""

import os

import pytest

pytest.importorskip("sphinx", reason="Sphinx, which builds the book, is not installed (pip install '.[docs]')")
import notebook_runs  # pyright: ignore[reportMissingImports]


def test_copies_are_the_notebooks_and_nothing_stays_that_has_none(tmp_path, monkeypatch):
    notebooks, docs = tmp_path / "notebooks", tmp_path / "docs"
    notebooks.mkdir()
    docs.mkdir()
    for name in ("01_a.py", "index.md", "matplotlibrc", "ruff.toml"):
        (notebooks / name).write_text(f"{name} é\n", encoding="utf-8")
    (notebooks / "running_clip").mkdir()
    (notebooks / "running_clip" / "view.npz").write_bytes(b"numbers")
    (docs / "notebooks").symlink_to(notebooks)  # as checkouts had it
    monkeypatch.setattr(notebook_runs, "DOCS", docs)
    monkeypatch.setattr(notebook_runs, "NOTEBOOKS", notebooks)
    notebook_runs.copy_notebooks(None)
    copies = docs / "notebooks"
    files = {"01_a.py", "index.md", "matplotlibrc"}
    assert not copies.is_symlink() and {file.name for file in copies.iterdir()} == files | {"running_clip"}
    assert (copies / "running_clip" / "view.npz").read_bytes() == b"numbers"
    assert len(list(notebooks.iterdir())) == 5

    os.utime(copies / "index.md", (1, 1))
    (notebooks / "01_a.py").write_text("new\n", encoding="utf-8")
    (copies / "02_stale.py").write_text("old\n", encoding="utf-8")
    notebook_runs.copy_notebooks(None)
    assert {file.name for file in copies.iterdir() if file.is_file()} == files
    assert all((copies / name).read_bytes() == (notebooks / name).read_bytes() for name in files)
    assert (copies / "index.md").stat().st_mtime == 1  # Sphinx does not read it again
