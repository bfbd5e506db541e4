"""The page *Where to change what*: typical changes, every file exists, and no change takes more files than it did."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "where_to_change.md"
CODE = ("reference/endotsr/", "golden/makers/")
CHANGES = {  # the most files that a change may take: of code, and as proof
    "loss term": (5, 7),
    "camera model": (3, 4),
    "reader of depth": (4, 3),
    "time basis": (4, 4),
    "parameter of each frame": (6, 3),
    "window of the SSIM": (1, 3),
    "flag": (1, 2),
    "golden case": (1, 3),
    "optimiser": (5, 4),
    "effect of the simulator": (4, 3),
    "row of the report": (1, 2),
    "key of a reader": (5, 6),
    "record of a run": (3, 4),
    "finding of": (3, 2),
}

SECTIONS = re.findall(r"^## \d+\. (.+?)\n(.*?)(?=^## |\Z)", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
IDS = [title for title, _ in SECTIONS]


def files_of(body: str, part: str) -> list[str]:
    """Paths of the list under **Code** or **Proof**."""
    text = body.split(f"**{part}**", 1)[1].split("\n**", 1)[0]
    return re.findall(r"^- `([^`]+)`", text, re.MULTILINE)


def test_every_path_in_the_text_exists():
    """A path with a folder starts at the root; a file beside another is named without one."""
    said = re.findall(r"`(\w[\w/]*/[\w/]+\.\w+)`", PAGE.read_text(encoding="utf-8"))
    assert said and [path for path in said if not (ROOT / path).is_file()] == []


def test_the_notebooks_that_print_the_objective_are_named():
    """A new term in the display of the specification has to be added there too."""
    display = (ROOT / "docs/specification/06_objective.md").read_text(encoding="utf-8").split("$$\n")[1].splitlines()[1]
    printing = [f"`notebooks/{file.name}`" for file in sorted((ROOT / "notebooks").glob("*.py"))
                if display in file.read_text(encoding="utf-8")]  # fmt: skip
    text = PAGE.read_text(encoding="utf-8")
    assert printing and [name for name in printing if name not in text] == []


def test_the_changes_are_all_there():
    assert len(SECTIONS) == len(CHANGES)
    assert all(change in title for change, title in zip(CHANGES, IDS, strict=True))


@pytest.mark.parametrize("body, most", [(body, most) for (_, body), most in zip(SECTIONS, CHANGES.values())], ids=IDS)
def test_every_file_exists_and_no_change_takes_more_files_than_it_did(body, most):
    code, proof = files_of(body, "Code"), files_of(body, "Proof")
    assert 0 < len(code) <= most[0] and 0 < len(proof) <= most[1]
    assert all(path.strip("[]").startswith(CODE) for path in code)
    for path in (*code, *proof):
        new = path.startswith("[")
        path = path.strip("[]")
        assert (ROOT / path).is_file() != new, f"{path}: {'exists' if new else 'not found'}"
        assert (ROOT / path).parent.is_dir(), f"{path}: no such folder"
