"""The layout is a program: imports run down, never round, and every room is on the list."""

import ast
import subprocess
import sys
import tomllib

import msgspec
import pytest

import house


def test_every_room_is_on_the_list():
    rooms = {house.room(name) for name in house.modules() if name}
    assert rooms <= set(house.ROOMS), "a new room needs its place in tests/house.py"


def test_every_line_is_counted_in_its_room():
    lines = house.lines_of()
    assert set(lines) - {"__init__"} == set(house.ROOMS)
    package = house.ROOT / "reference" / "endotsr"
    assert sum(lines.values()) == sum(len(f.read_text(encoding="utf-8").splitlines()) for f in package.rglob("*.py"))
    losses = (package / "method" / "losses").rglob("*.py")
    assert lines["method.losses"] == sum(len(file.read_text(encoding="utf-8").splitlines()) for file in losses)


@pytest.mark.parametrize("room", ["clips/opencv", "clips/sequences", "clips/sequences/checks"])
def test_the_index_of_a_room_names_its_modules(room):
    """The indented lines of the docstring: names, then two spaces or the end of the line, then what they hold."""
    folder = house.ROOT / "reference" / "endotsr" / room
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
    lines = [line[4:] for line in text.splitlines() if line.startswith("    ") and line[4:5].strip()]
    named = [name for line in lines for name in line.split("  ")[0].rstrip(",").split(", ")]
    inside = {path.stem for path in folder.glob("[!_]*.py")}
    inside |= {path.parent.name for path in folder.glob("*/__init__.py")}
    assert sorted(named) == sorted(inside)


def test_imports_run_down_only():
    """Between rooms; import-linter checks the storeys (`lint-imports`, in `pyproject.toml`)."""
    assert house.upward() == []


def test_the_storeys_of_import_linter_are_those_of_the_house():
    contract = tomllib.loads((house.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = [name.removeprefix("endotsr.") for name in contract["contracts"][0]["layers"]]
    above_definition = [name for name in house.STOREYS if name not in ("errors", "untrusted", "config", "definition")]
    assert layers[: len(above_definition)] == above_definition[::-1]
    assert set(layers) == set(house.STOREYS)


def test_no_modules_import_one_another():
    assert house.circles() == []


def test_the_definition_knows_numpy_alone():
    """The definition and the compiled functions share no line, so that one can test the other."""
    known = {"numpy", "collections", "endotsr"}
    for name, tree in house.modules().items():
        if house.room(name) == "definition":
            nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
            more = {"signal"} if name == "definition.__main__" else set()  # its output may be a pipe that closes
            assert {part.split(".")[0] for node in nodes for part in house.names_of(node)} <= known | more, name
    assert {house.room(b) for a, b in house.imports() if house.room(a) == "definition"} == {"definition"}
    users = {house.room(a) for a, b in house.imports() if house.room(b) == "definition"}
    assert users == {"definition", "port.operations"}, "nothing that is fitted computes with the definition"


def test_functions_of_the_definition_are_short():
    """A function is one formula and its reverse; `python tests/house.py` prints the size of the whole."""
    assert {f.name: f.lines for f in house.functions() if f.name.startswith("definition.") and f.lines > 25} == {}


def test_the_definition_starts_without_a_compiler():
    code = (
        "import sys, endotsr.definition.train; print(sorted({'numba', 'scipy', 'cv2', 'msgspec'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_equations_know_nothing_but_kernels():
    used = {house.room(b) for a, b in house.imports() if house.room(a) == "method.equations"}
    assert used <= {"method.equations", "method.kernels", "errors"}


def test_the_trainer_knows_no_file_format():
    known = {
        "clips.sequences.sequence", "clips.sequences.splits", "clips.flow.between",
        "clips.flow.between_kernels", "clips.sequences.smaller",
    }  # fmt: skip
    assert {
        b for a, b in house.imports() if house.room(a) == "training.fitting" and house.room(b) == "clips.sequences"
    } <= known


def test_rooms_of_the_method_import_no_instrument():
    """Beside one another they know the ground alone, and of the readers the sequence as it is held in memory."""
    known = {*house.METHOD, *house.GROUND}
    assert [(a, b) for a, b in house.imports() if house.room(a) in house.METHOD and house.room(b) not in known] == []


def test_the_package_imports_nothing_that_is_not_installed():
    """Makers of golden vectors and of pages import the package, never the other way."""
    beside = {"makers", "make", "pages"}
    assert all((house.ROOT / name).exists() for name in ("golden/makers", "docs/make.py", "docs/pages"))
    for name, tree in house.modules().items():
        found = {alias.name for n in ast.walk(tree) if isinstance(n, ast.Import) for alias in n.names}
        found |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        assert not {module.split(".")[0] for module in found} & beside, name


@pytest.mark.parametrize("name", ["training.scene", "method.splatting", "method.losses", "method.equations"])
def test_what_is_fitted_does_not_know_the_optimiser(name):
    assert not [b for a, b in house.imports() if house.room(a) == name and house.room(b) == "training.fitting"]


def test_data_between_rooms_is_typed():
    """The number of lines with `dict[str, Any]` only falls: set it lower where a change makes it lower."""
    assert sum(house.untyped().values()) <= 35, house.untyped()


def test_no_function_is_long():
    assert {f.name: f.lines for f in house.functions() if f.lines > house.LONGEST_FUNCTION} == {}


def test_no_function_takes_many_arguments_by_position():
    """A named tuple in their place costs nothing in a kernel."""
    assert {f.name: f.positional for f in house.functions() if f.positional > house.MOST_POSITIONAL} == {}


def test_settings_and_commands_are_counted():
    """Read from the sources, they are those that the package has."""
    from endotsr.cli.main import COMMANDS
    from endotsr.config import PAPER

    data = msgspec.to_builtins(PAPER)
    preset = data.pop("preset")
    assert house.settings() == ["preset"] * bool(preset) + [f"{name}.{key}" for name in data for key in data[name]]
    assert house.commands() == [*COMMANDS]


def test_an_import_that_runs_up_is_seen(tmp_path):
    package = tmp_path / "reference" / "endotsr"
    for name, text in (
        ("method/kernels/jit.py", "from endotsr.training.scene import gaussians\n"),
        ("training/scene/gaussians.py", "import endotsr.method.kernels.jit\n"),
    ):
        (package / name).parent.mkdir(parents=True)
        (package / name).write_text(text)
    assert house.upward(tmp_path) == ["method.kernels.jit -> training.scene.gaussians"]
    assert house.circles(tmp_path) == [["method.kernels.jit", "training.scene.gaussians"]]
