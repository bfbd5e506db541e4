"""What to run after a change: python tests/after.py [REVISION] [--run]

Compares the working tree with REVISION (the last commit by default; with a clean tree, the commit before it), and
prints the commands in order: lint, types of the changed files, the golden cases to make again, the lists that have to
name a new component, the other programs whose output depends on the change, the tests of names, words and generated
tables, the mistakes of a changed table, which the judge has to refuse and to name, the tests of the rooms that it
touches, and all other tests that import a changed module, which take longest.
`--run` runs them and stops at the first that fails. It leaves out `golden/make.py write`, because no run of tests
rewrites its expected values, and says so in its first lines: run that command before.
"""

import argparse
import ast
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = "reference/endotsr/"
FORMATTED = ("reference", "golden", "tests", "notebooks", "docs/_extensions", "docs/pages", "docs/make.py")
# Hold for the whole tree: names, words, layers, generated tables. They take minutes, and less than any room.
ALWAYS = (
    "tests/test_layout.py",
    "tests/test_conventions.py",
    *(f"tests/docs/test_{name}.py" for name in ("glossary", "strong_words", "bare_figures", "generated_pages")),
)
# Compare lists that are written by hand with the package: what is missing there shows in seconds, not after minutes.
LISTS = (
    "tests/definition/test_door.py",
    "tests/port/vectors/test_families.py::test_every_array_of_a_case_has_axes_for_the_request_to_a_port",
    "tests/port/vectors/test_hard_coded.py::test_every_setting_takes_two_values",
)
LISTED = ("golden/", *(f"{PACKAGE}{room}" for room in ("config.py", "definition/", "method/", "port/", "training/")))
WRITE = "python golden/make.py write"
MISTAKE = "tests/port/vectors/test_wrong_ports.py::test_a_wrong_port_is_refused_and_named"
# Beginning of a changed path -> commands whose output depends on it.
CONSTANTS, INVENTORIES = "python docs/make.py ports.settings", "python docs/make.py recordings.inventories"
OPERATIONS = "python docs/make.py ports.operations"
RECORDED = tuple(  # of the records of single runs, which these programs find by the beginning of their names
    f"python docs/make.py {name}"
    for name in (
        "full_size.record",
        "book.presets",
        "book.readme_gaps",
        "book.texture",
        "book.figures",
        "bench",
        "claims",
        "full_size",
    )
)
MAKERS = {
    f"{PACKAGE}config.py": ("python docs/make.py book.settings", CONSTANTS),
    f"{PACKAGE}definition/": ("python docs/make.py book.definitions",),
    f"{PACKAGE}clips/sequences/layouts/": (INVENTORIES,),
    f"{PACKAGE}clips/sequences/checks/kinds.py": (INVENTORIES,),
    f"{PACKAGE}clips/formats/calibration_fields.py": (INVENTORIES,),
    f"{PACKAGE}cli/parts/related_options.py": (INVENTORIES,),
    "docs/results/pulling_": RECORDED,
    "docs/results/cutting_": RECORDED,
    "notebooks/": ("python docs/make.py book.chapters",),
    "golden/cases/": (CONSTANTS,),
    "golden/makers/": (OPERATIONS,),
    f"{PACKAGE}port/judge/profiles.py": (OPERATIONS,),
    f"{PACKAGE}port/operations/": (OPERATIONS,),
}
# Recordings as users have them, which the commands read through several rooms.
INPUTS = ("tests/clips/sequences/inputs", "tests/clips/sequences/layouts")
# Beginning of a changed path -> tests beside those of its room.
MORE = {
    f"{PACKAGE}definition/": ("tests/definition", "tests/test_specification.py", "tests/docs/test_live.py"),
    f"{PACKAGE}method/": ("tests/test_gradcheck.py", "tests/definition/test_twins.py"),
    f"{PACKAGE}method/losses/": tuple(f"tests/training/fitting/test_{name}.py" for name in ("objective", "zero_cost")),
    f"{PACKAGE}port/operations/": (
        "tests/test_gradcheck.py",
        "tests/definition/test_twins.py",
        "tests/docs/test_equation_map.py",
    ),
    f"{PACKAGE}clips/sequences/": ("tests/docs/test_generated_pages.py",),
    f"{PACKAGE}clips/formats/": (*INPUTS, "tests/docs/test_generated_pages.py"),
    f"{PACKAGE}clips/prepare/": INPUTS,
    f"{PACKAGE}config.py": ("tests/test_specification.py", "tests/cli/test_cli_options.py", "tests/port/vectors"),
    f"{PACKAGE}training/fitting/records.py": ("tests/results/report",),
    "tests/fuzz/": ("tests/fuzz",),
    f"{PACKAGE}api.py": ("tests/test_api.py",),
    f"{PACKAGE}cli/": ("tests/cli",),
    "golden/": ("tests/port/vectors", "tests/port/judge/test_profiles.py", "tests/docs/test_equation_map.py"),
    "docs/specification/": (
        "tests/test_specification.py",
        "tests/docs/test_derivations.py",
        "tests/test_notebooks.py::test_displays_are_those_of_the_specification",
    ),
    "docs/": ("tests/docs",),
    "README.md": ("tests/docs/test_readme.py",),
}


def git(*words: str) -> list[str]:
    """Lines of the output."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def changed(revision: str | None) -> list[str]:
    """Paths that differ from the revision, files that git does not know included; deleted files left out.

    With a clean tree and no revision, a line of stderr says that the last commit is examined.
    """
    new = git("ls-files", "--others", "--exclude-standard")
    clean = not (revision or new or git("diff", "--name-only", "HEAD"))
    if clean:
        print("# nothing is changed: the commands for the last commit, HEAD~1 to HEAD", file=sys.stderr)
    base = revision or ("HEAD~1" if clean else "HEAD")
    return sorted({*git("diff", "--name-only", "--diff-filter=d", base), *new})


def makers(paths: list[str]) -> list[str]:
    """Programs whose output depends on the paths; a record belongs to the programs that name it."""
    touched = [names for start, names in MAKERS.items() if any(path.startswith(start) for path in paths)]
    families = [Path(path).stem for path in paths if path.startswith("golden/makers/") and path.endswith(".toml")]
    found = [f"{WRITE} {name}" for name in families]
    found += [name for names in touched for name in names]
    records = {Path(path).name for path in paths if path.startswith("docs/results/") and path.endswith(".json")}
    for file in sorted((ROOT / "docs" / "pages").glob("*/*.py")):
        text = file.read_text(encoding="utf-8")
        if "\nPROGRAM = Program(" in text and any(f'"{name}"' in text for name in records):
            name = file.parent.name if file.stem == "page" else f"{file.parent.name}.{file.stem}"
            found.append(f"python docs/make.py {name}")
    return list(dict.fromkeys(found))


def mistakes(paths: list[str]) -> list[str]:
    """The slow test of every mistake of the changed tables: the judge refuses it, and names it."""
    tables = [path for path in paths if path.startswith("golden/makers/") and path.endswith(".toml")]
    entries = [tomllib.loads((ROOT / path).read_text(encoding="utf-8")) for path in tables]
    tests = [f"{MISTAKE}[{flag}]" for table in entries for flag, entry in table.items() if isinstance(entry, dict)]
    return [f"pytest -q -m slow -n 0 {shlex.join(tests)}"] if tests else []


def tests_of(path: str) -> list[str]:
    """Tests of a path: the file itself, the folder of its room, and what `MORE` names."""
    if path.startswith("tests/") and Path(path).name.startswith("test_"):
        return [path]
    found = [name for start, names in MORE.items() if path.startswith(start) for name in names]
    if path.startswith(PACKAGE):
        parts = Path(path.removeprefix(PACKAGE)).parts[:-1]
        for depth in (3, 2, 1):
            folder = "/".join(("tests", *parts[:depth]))
            if len(parts) >= depth and (ROOT / folder).is_dir():
                return [folder, *found]
    if path.startswith("notebooks/") and path.endswith(".py"):
        found += ["tests/test_notebooks.py", "tests/docs/test_live.py"]
    return found


def importing(paths: list[str]) -> list[str]:
    """Files of tests that import a changed module of the package by its full name."""
    names = {path.removeprefix("reference/").removesuffix(".py").replace("/", ".") for path in paths}
    found = []
    for file in sorted((ROOT / "tests").rglob("test_*.py")):
        nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if names & {node.module for node in nodes if isinstance(node, ast.ImportFrom)}:
            found.append(file.relative_to(ROOT).as_posix())
    return found


def tested(paths: list[str]) -> list[str]:
    """The tests of the rooms, then the other tests that import a changed module; a folder stands for its files."""
    tests = dict.fromkeys(test for path in paths for test in tests_of(path) if test not in ALWAYS)
    folders = {test for test in tests if not test.partition("::")[0].endswith(".py")}
    outside = lambda test: not any(str(up) in folders for up in Path(test).parents)
    near = filter(outside, tests)
    far = (test for test in importing(paths) if outside(test) and test not in {*tests, *ALWAYS})
    return [f"pytest -q --maxfail 3 {words}" for words in map(" ".join, (near, far)) if words]


def commands(paths: list[str]) -> list[str]:
    """All commands, in the order in which they fail fastest."""
    typed = [
        p for p in paths if p.endswith(".py") and p.startswith(("reference/", "golden/make", "docs/make", "docs/pages"))
    ]
    rooms = " ".join(FORMATTED)
    programs = makers(paths)
    written = [name for name in programs if name.startswith(WRITE)]
    return [
        f"ruff check {rooms}",
        f"ruff format --check {rooms}",
        "lint-imports",
        *([f"pyright {' '.join(typed)}"] if typed else []),
        *written,  # a list below reads the stored cases, and refuses those of another VERSION
        *([f"pytest -q -n 0 {' '.join(LISTS)}"] if any(path.startswith(LISTED) for path in paths) else []),
        *(name for name in programs if name not in written),
        f"pytest -q -n 0 {' '.join(ALWAYS)}",
        *mistakes(paths),
        *tested(paths),
    ]


def main(words: list[str]) -> int:
    """Print the commands; with --run, run them. Returns: the exit code of the first that fails, or 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revision", metavar="REVISION", nargs="?")
    parser.add_argument("--run", action="store_true")
    given = parser.parse_args(words)
    try:
        paths = changed(given.revision)
    except subprocess.CalledProcessError as error:
        parser.error(error.stderr.strip() or f"git ended with code {error.returncode}")
    found = commands(paths)
    left_out = [command for command in found if given.run and command.startswith(WRITE)]
    for command in left_out:
        print(f"{command}  (left out: run it first)", flush=True)
    for command in (command for command in found if command not in left_out):
        print(command, flush=True)
        if given.run:
            code = subprocess.run(shlex.split(command), cwd=ROOT, check=False).returncode
            if code:
                return code
    return 0


if __name__ == "__main__":
    from endotsr.cli.parts.closed_pipe import until_closed

    sys.exit(until_closed(lambda: main(sys.argv[1:])))
