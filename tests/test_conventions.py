"""Conventions are programs: what the package promises about its own text is checked here."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from endotsr.port.gradcheck import all_pairs, definition_pairs

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "reference" / "endotsr"
SOURCES = sorted(PACKAGE.rglob("*.py"))
MAKERS = [ROOT / "golden" / "make.py", *sorted((ROOT / "golden" / "makers").glob("*.py"))]
PAGES = sorted((ROOT / "docs" / "pages").rglob("*.py"))
ORACLES = sorted((ROOT / "tests" / "oracle").rglob("*.py"))
WORD = "grad" + "check"  # spelled apart, so that no test here is selected by it
MAXIMUM_LINES = 500
CONTRACTING = {  # the fast compositing, and the peak of the machine beside it
    *("method/splatting/fast/blocks.py", "method/splatting/fast/tiles.py"),
    "studies/bench/peaks.py",
}
PEERS = [  # another program beside ours
    ROOT / "docs" / "pages" / name for name in ("bench/gsplat.py", "bench/peers.py", "full_size/network.py")
]

# Pieces of the method that tests reach beside its public functions: compiled code that no argument selects.
PIECES = {
    "method.equations.appearance._squash_kernel",
    "method.equations.laplacian._expand_support",
    "method.equations.laplacian._reduce_support",
    "method.kernels.vectors._register_bytes",
    "method.losses.masked_ssim._column_moments",
    "method.losses.masked_ssim._difference_and_sum_kernel",
    "method.losses.masked_ssim._row_moments",
    "method.losses.masked_ssim._similarity_kernel",
    "method.losses.smoothness._total_variation",
    "method.losses.smoothness._variation_reverse_kernel",
    "training.scene.density_control._rotations",
    "method.splatting.binning._boxes_kernel",
    "method.splatting.compositing._composite_kernel",
    "method.splatting.fast.blocks._blend_kernel",
    "method.splatting.fast.blocks._lane_tables_kernel",
    "method.splatting.fast.blocks._visit_kernel",
    "method.splatting.fast.blocks._visits_kernel",
}

# Forward functions whose check runs under the name of another pair, and why.
ALIASES: dict[str, str] = {}


def module_name(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def parse(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), str(file))


def public_functions(file: Path) -> dict[str, int]:
    return {n.name: n.lineno for n in parse(file).body if isinstance(n, ast.FunctionDef) and n.name[0] != "_"}


def imported(file: Path) -> set[str]:
    """Top-level names of everything a file imports, inside functions too."""
    found: set[str] = set()
    for node in ast.walk(parse(file)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").split(".")[0] if node.level == 0 else "endotsr")
    return found


def private_names(file: Path) -> set[str]:
    """Private names of the package that a file imports, reads from an imported module or names in a string."""
    known, found = {module_name(f) for f in SOURCES}, set()
    modules: dict[str, str] = {}  # word of the file -> module
    tree = parse(file)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("endotsr"):
            for alias in node.names:
                dotted = f"{node.module}.{alias.name}"
                modules |= {alias.asname or alias.name: dotted} if dotted in known else {}
                found |= {dotted} if alias.name[0] == "_" else set()
    for node in ast.walk(tree):
        reached = []
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            reached = [(node.value.id, node.attr)]
        elif isinstance(node, ast.Call) and len(node.args) > 1:  # monkeypatch.setattr(module, "_name", ...)
            first, second = node.args[:2]
            if isinstance(first, ast.Name) and isinstance(second, ast.Constant):
                reached = [(first.id, str(second.value))]
        found |= {f"{modules[word]}.{name}" for word, name in reached if word in modules and name[0] == "_"}
        if isinstance(node, ast.Constant) and re.fullmatch(r"endotsr(\.\w+)*\._\w+", str(node.value)):
            found.add(str(node.value))
    return {name.removeprefix("endotsr.") for name in found if not name.endswith("__")}


OPERATIONS = [(file, name) for file in SOURCES for name in public_functions(file) if name.endswith("_forward")]


@pytest.mark.parametrize("file, name", OPERATIONS, ids=[name for _, name in OPERATIONS])
def test_every_forward_has_a_reverse_directly_below_it(file, name):
    functions = public_functions(file)
    reverse = name.removesuffix("_forward") + "_reverse"
    assert reverse in functions, f"{module_name(file)}.{name} has no {reverse} in the same module"
    assert functions[reverse] > functions[name], f"{reverse} stands above {name}"


@pytest.mark.parametrize("file, name", OPERATIONS, ids=[name for _, name in OPERATIONS])
def test_every_forward_is_named_by_a_pair(file, name):
    dotted = f"{module_name(file)}.{name}"
    functions = {pair.function for pair in (*all_pairs().values(), *definition_pairs().values())}
    assert ALIASES.get(dotted, dotted) in functions, f"{dotted} is not checked: register an operation that names it"


def test_every_pair_names_a_function_of_the_package():
    known = {f"{module_name(file)}.{name}" for file in SOURCES for name in public_functions(file)}
    assert {pair.function for pair in all_pairs().values()} <= known
    assert set(ALIASES) <= known


def test_compiled_kernels_go_through_the_one_jit():
    """numba is imported for types and thread counts, but nothing except jit.py decides how a kernel is compiled."""
    for file in SOURCES:
        if file.name == "jit.py":
            continue
        for node in ast.walk(parse(file)):
            if isinstance(node, ast.Attribute | ast.Name):
                name = node.attr if isinstance(node, ast.Attribute) else node.id
                assert name not in ("njit", "vectorize", "guvectorize", "stencil", "generated_jit"), (
                    f"{file}:{node.lineno}"
                )
            if isinstance(node, ast.keyword):
                assert node.arg != "fastmath", f"{file}:{node.value.lineno}: fastmath"


def test_contraction_only_in_the_fast_compositing():
    """`jit(contract=True)` may change the last digit: only the kernels that `exact` checks to a bound use it."""
    uses = [f for f in SOURCES for n in ast.walk(parse(f)) if isinstance(n, ast.keyword) and n.arg == "contract"]
    assert {f.relative_to(PACKAGE).as_posix() for f in uses} == CONTRACTING


@pytest.mark.parametrize("file", ORACLES, ids=lambda file: file.name)
def test_oracles_import_nothing_of_the_package(file):
    assert "endotsr" not in imported(file)
    assert "importlib" not in imported(file)


def test_tests_use_what_is_public():
    """Private names change freely; the pieces of the method that tests reach are listed, and none in vain."""
    files = [f for f in (ROOT / "tests").rglob("*.py") if "mutation" not in f.parts]
    assert set().union(*map(private_names, files)) == PIECES


def test_one_name_is_one_class():
    """A word of the package is one thing: no two modules define a public class of one name."""
    found: dict[str, list[str]] = {}
    for file in SOURCES:
        for node in parse(file).body:
            if isinstance(node, ast.ClassDef) and node.name[0] != "_":
                found.setdefault(node.name, []).append(module_name(file).removeprefix("endotsr."))
    twice = {name: modules for name, modules in found.items() if len(modules) > 1}
    assert twice == {}


def test_text_is_written_with_its_encoding_and_line_end():
    """The defaults of Windows are another encoding and CRLF, which checksums, ports and other systems would see."""
    wrong = []
    for file in SOURCES:
        for node in (node for node in ast.walk(parse(file)) if isinstance(node, ast.Call)):
            given, called = (
                {word.arg for word in node.keywords},
                getattr(node.func, "attr", getattr(node.func, "id", "")),
            )
            modes = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
            text = called == "write_text" or (called == "open" and any(set(m) <= set("wax+t") for m in modes if m))
            if text and not {"encoding", "newline"} <= given:
                wrong.append(f"{module_name(file)}:{node.lineno}: encoding and newline")
            if called == "read_text" and isinstance(node.func, ast.Attribute) and "encoding" not in given:
                wrong.append(f"{module_name(file)}:{node.lineno}: encoding")
    assert wrong == []


def test_no_link_is_part_of_the_tree():
    """A clone on Windows holds a text file in its place."""
    assert [str(path) for path in ROOT.glob("[!.]*/*") if path.is_symlink()] == []  # .venv holds links of its own


def test_no_file_is_too_long():
    files = [*SOURCES, *MAKERS, *PAGES, *(ROOT / "tests").rglob("*.py")]
    lengths = {str(f.relative_to(ROOT)): len(f.read_text(encoding="utf-8").splitlines()) for f in files}
    long = {name: n for name, n in lengths.items() if n > MAXIMUM_LINES}
    assert not long, f"divide it by subject, at most {MAXIMUM_LINES} lines each: {long}"


@pytest.mark.parametrize("library", ["torch", "jax", "tensorflow", "autograd", "pickle", "dill", "joblib"])
def test_no_autodiff_library_and_no_pickle(library):
    assert [str(f) for f in (*SOURCES, *MAKERS, *PAGES) if library in imported(f) and f not in PEERS] == []


def test_comparisons_with_other_programs_load_them_inside_functions_only():
    for file in PEERS:
        at_the_top = [n for n in parse(file).body if isinstance(n, ast.Import | ast.ImportFrom)]
        loaded = [n.module if isinstance(n, ast.ImportFrom) else n.names[0].name for n in at_the_top]
        assert not {"torch", "gsplat"} & {str(name).split(".")[0] for name in loaded}, file


def test_no_pickle_through_numpy():
    for file in (*SOURCES, *MAKERS, *PAGES):
        for node in ast.walk(parse(file)):
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert isinstance(node.value, ast.Constant) and node.value.value is False, f"{file}:{node.value.lineno}"


@pytest.mark.parametrize(
    ("library", "files"),
    [("cv2", ["clips/opencv/library.py"]), ("av", ["clips/formats/film_file.py", "clips/formats/video_file.py"])],
)
def test_a_decoder_is_imported_in_one_file_and_an_encoder_in_another(library, files):
    assert [f.relative_to(PACKAGE).as_posix() for f in SOURCES if library in imported(f)] == files


@pytest.mark.slow
def test_selection_by_word_is_the_registry():
    """`pytest -k` with the word collects exactly one check per registered pair and nothing else."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "--collect-only",
        "-q",
        "-n",
        "0",
        "-k",
        WORD,
        "-p",
        "no:cacheprovider",
        "tests",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    collected = {line.strip() for line in done.stdout.splitlines() if "::" in line}
    wanted = {f"tests/test_{WORD}.py::test_{WORD}[{seed}-{name}]" for name in all_pairs() for seed in (0, 1)}
    assert collected == wanted, done.stdout[-2000:]


def test_no_two_test_files_have_one_name():
    """Files without a package are imported by their name: the second one would not be collected."""
    names = [file.name for file in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
