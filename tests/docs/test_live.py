"""Chapters that run in their page run on NumPy, Matplotlib and the definition alone; a compiled import fails them."""

import hashlib
import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from pages.live import fetch, helpers, page
from pages.live.bundle import CHAPTERS, cells, files, formulas, needs_clip
from pages.live.supply import LOCK, File, Supply, needed, supply
from pages.live.table import HOMES, OPERATIONS, OWN

ROOT = Path(__file__).parents[2]
# What Pyodide's packages bring, and the files of the page; everything else that is installed here is absent there.
PRESENT = "numpy matplotlib mpl_toolkits PIL contourpy cycler fontTools kiwisolver packaging pyparsing dateutil six"
RUNNER = """
import json, sys

PRESENT = set(WORDS.split()) | {"endotsr", "running_clip", "pages"}

class Absent:
    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top not in PRESENT and top not in sys.stdlib_module_names and not top.startswith("_sysconfigdata"):
            raise ModuleNotFoundError(f"{name} is absent in the page")

sys.meta_path.insert(0, Absent())
sys.path.insert(0, ".")
from pages.live import cells, table

table.install()
cells.quiet()
print(json.dumps([cells.run(*words) for words in json.load(sys.stdin)]))
"""


def answers(folder, chapter, runs):
    """What the page would show for `runs`, (source, title, formula) each, in a process that has its files alone."""
    for name, content in files(chapter).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    script = RUNNER.replace("WORDS", repr(PRESENT))
    done = subprocess.run(
        [sys.executable, "-I", "-c", script], cwd=folder, input=json.dumps(runs), capture_output=True, text=True
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


def numbered(chapter):
    """The cells of a chapter as runs."""
    return [(source, f"cell {k}", "") for k, source in enumerate(cells(chapter), start=1)]


# Chapter -> a formula, a text in it, and what breaks it.
MISTAKES = {
    "01_dictionary": ("dictionary.dictionary_reverse", "d_sine * cosine - d_cosine", "d_sine * cosine + d_cosine"),
    "02_colour_residual": ("appearance.appearance_reverse", "beta / Y00 *", "beta *"),
    "04_deformation": ("deformation.deformation_reverse", "4 * delta**3", "2 * delta**3"),
    "05_motion_and_prior": ("motion.motion_reverse", "d_translation, c)", "2 * d_translation, c)"),
    "06_covariance": ("covariance.covariance_reverse", "d_shape.scale * scale", "d_shape.scale"),
    "07_projection": ("projection.point_reverse", "by_scale - g_xy", "by_scale + g_xy"),
    "08_harmonics": ("harmonics.harmonics_reverse", "d_n - (n * d_n).sum(axis=0) * n", "d_n"),
    "10_laplacian_pyramid": ("laplacian.laplacian_loss_reverse", "d_coarse - u_rows.T", "d_coarse + u_rows.T"),
}


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_chapter_runs_and_its_gradient_check_fails_for_a_wrong_formula(chapter, tmp_path):
    """All cells pass; a formula with a mistake fails the gradient check; its own text passes again."""
    runs = numbered(chapter)
    (check,) = (run for run in runs if re.search(r"\bcheck_(pair|function)\(", run[0]))
    name, old, new = MISTAKES[chapter]
    dotted = f"endotsr.definition.{name}"
    text = formulas(chapter)[dotted]
    assert old in text
    edited = [(text.replace(old, new), "formula", dotted), check, (text, "formula", dotted), check]
    *found, wrong, failed, right, passed = answers(tmp_path, chapter, runs + edited)
    assert [(k, one["error"]) for k, one in enumerate(found, start=1) if one["error"]] == []
    assert sum(len(one["figures"]) for one in found) == sum("plt.show()" in run[0] for run in runs)
    assert wrong["error"] == right["error"] == "" and "FAILED" in failed["text"]
    assert failed["error"].endswith("AssertionError\n") and f'File "{check[1]}", line' in failed["error"]
    assert passed["error"] == "" and passed["text"] == found[runs.index(check)]["text"]


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("from endotsr.training.fitting.trainer import training_step", "it does not run in the page"),
        ("from endotsr.method.equations.dictionary import DEAD_RMS", "has no place in the definition"),
        ("import numba", "is absent in the page"),
    ],
)
def test_a_planted_import_of_a_compiled_room_fails(source, why, tmp_path):
    first, other = answers(tmp_path, CHAPTERS[1], [(source, "cell 1", ""), ("1 + 1", "cell 2", "")])
    assert why in first["error"] and 'File "cell 1", line 1' in first["error"]
    assert other == {"text": "2\n", "figures": [], "error": ""}


def test_a_formula_has_to_define_its_function(tmp_path):
    dotted = "endotsr.definition.motion.motion_forward"
    runs = [("other = 1", "formula", dotted), ("def f(:", "formula", dotted)]
    one, two = answers(tmp_path, CHAPTERS[1], runs)
    assert "has to define the function motion_forward" in one["error"] and "SyntaxError" in two["error"]


def test_every_name_of_the_table_is_in_the_compiled_module_and_in_the_definition():
    for compiled, names in OWN.items():
        assert all(hasattr(import_module(compiled), name) for name in names), compiled
    for compiled, homes in HOMES.items():
        for home, names in homes.items():
            for name in names.split():
                assert hasattr(import_module(compiled), name), (compiled, name)
                assert hasattr(import_module(f"endotsr.definition.{home}"), name), (home, name)
    assert all((ROOT / f"reference/endotsr/port/operations/{name}.py").is_file() for name in OPERATIONS)


def test_the_report_of_the_atoms_is_that_of_the_package():
    package = import_module("endotsr.method.equations.dictionary")
    omega = package.frequencies(8, 1.0, 16.0)
    for times in (np.arange(32) / 32, np.delete(np.arange(24), [1, 9, 17]) / 24, np.arange(6) / 63, np.zeros(1)):
        found, expected = helpers.report_atoms(times, omega), package.report_atoms(times, omega)
        assert (found.rank, found.dead, found.weak) == (expected.rank, expected.dead, expected.weak)
        np.testing.assert_allclose(found.condition, expected.condition, rtol=1e-9)


def test_the_helpers_project_as_the_package_does():
    """Values and gradients of wide Gaussians, one behind the camera, by the helper and by the compiled function."""
    package = import_module("endotsr.method.splatting.projection")
    compiled = import_module("endotsr.method.splatting.covariance")
    settings = import_module("endotsr.method.splatting.settings").PAPER
    rng = np.random.default_rng(3)
    shape, _ = compiled.covariance_forward(rng.normal(size=(4, 5)), rng.normal(-1, 0.5, (3, 5)))
    camera = helpers.Camera(np.eye(3), np.array([0.1, 0, 0]), 60.0, 66.0, 33.0, 23.5, 64, 48)
    position = rng.uniform(-1, 1, (3, 5)) + np.array([[0], [0], [4]])
    position[2, 0] = -4
    given = [rng.normal(size=(2, 5)), rng.normal(size=(3, 5)), rng.normal(size=5)]
    out, saved = helpers.projection_forward(position, shape, camera, settings)
    expected, there = package.projection_forward(position, shape, camera, settings)
    for found, value in zip(out, expected):
        np.testing.assert_allclose(found, value, rtol=1e-10, atol=1e-12)
    for name in ("projection_reverse", "projection_reverse_footprint"):
        grads, others = getattr(helpers, name)(*given, saved), getattr(package, name)(*given, there)
        for found, value in zip(grads[:3], others[:3]):
            np.testing.assert_allclose(found, value, rtol=1e-8, atol=1e-10)


def test_a_chapter_reads_the_clip_only_if_it_imports_it():
    assert [name for name in CHAPTERS if needs_clip(name)] == ["01_dictionary"]
    assert not any(name.startswith("running_clip/") for name in files("02_colour_residual"))


def test_all_cells_of_the_record_passed():
    record = page.PROGRAM.read()
    for name in CHAPTERS:
        row = record["chapters"][name]
        assert row["passed"] == row["cells"] == len(cells(name)), name


# ---- the folder of Pyodide ----


@pytest.fixture
def published(tmp_path, monkeypatch):
    """A folder with the files of a small Pyodide, and its table in the place of the true one."""
    folder = tmp_path / "published"
    folder.mkdir()
    wheel = {name: f"{name} of the test".encode() for name in ("numpy.whl", "pyodide.js")}
    lock = {"packages": {"numpy": {"file_name": "numpy.whl", "depends": [], "sha256": digest(wheel["numpy.whl"])}}}
    contents = wheel | {LOCK: json.dumps(lock).encode()}
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    table = {name: File(digest(content), len(content)) for name, content in contents.items()}
    monkeypatch.setattr(fetch, "supply", lambda: Supply("1", "https://book.invalid/", ["numpy"], table))
    return folder


def digest(content):
    """SHA-256 of bytes."""
    return hashlib.sha256(content).hexdigest()


def test_the_folder_is_filled_from_published_files(published, tmp_path, capsys):
    fetch.main([str(tmp_path / "filled"), "--from", str(published)])
    names = {path.name for path in (tmp_path / "filled").iterdir()}
    assert names == {"numpy.whl.js", "pyodide.js.js", f"{LOCK}.js", fetch.FILLED}
    assert "every SHA-256 as published" in capsys.readouterr().out


def test_another_wheel_is_refused_and_the_folder_is_not_used(published, tmp_path):
    fetch.fill(tmp_path / "filled", published)
    (published / "numpy.whl").write_bytes(b"another")
    with pytest.raises(SystemExit, match=r"numpy\.whl: SHA-256 .* not the file of this version"):
        fetch.fill(tmp_path / "filled", published)
    assert not (tmp_path / "filled" / fetch.FILLED).exists()


def test_a_table_that_differs_from_the_lock_file_is_refused(published):
    lock = json.loads((published / LOCK).read_bytes())
    lock["packages"]["numpy"]["sha256"] = "0" * 64
    with pytest.raises(SystemExit, match=r"numpy\.whl: supply\.json has .* the lock file of Pyodide 0000"):
        fetch.check_lock(lock, fetch.supply())


def test_an_absent_file_is_named_with_a_remedy(published):
    (published / "pyodide.js").unlink()
    with pytest.raises(SystemExit, match=r"pyodide\.js: .*add it to the folder"):
        fetch.fill(published.parent / "filled", published)


def test_the_table_pins_every_file():
    table = supply()
    assert all(re.fullmatch("[0-9a-f]{64}", file.sha256) and file.bytes > 0 for file in table.files.values())
    assert {"pyodide.js", "pyodide.asm.js", "pyodide.asm.wasm", "python_stdlib.zip", LOCK} < table.files.keys()
    assert table.host.startswith("https://") and f"v{table.version}/" in table.host
    assert needed({"packages": {"a": {"file_name": "a.whl", "sha256": "1", "depends": ["b"]},
                                "b": {"file_name": "b.whl", "sha256": "2", "depends": ["a"]}}}, ["a"]) == {
        "a.whl": "1", "b.whl": "2"}  # fmt: skip
