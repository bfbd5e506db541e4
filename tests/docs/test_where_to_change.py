"""The page *Where to change what*: ten changes, every listed file exists, and four files of code are enough."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "where_to_change.md"
PACKAGE = "reference/endotsr/"
MOST = 4  # files of code of one change, unless the page gives the reason
CHANGES = (
    "loss term",
    "camera model",
    "reader of depth",
    "time basis",
    "parameter of each frame",
    "window of the SSIM",
    "flag",
    "golden case",
    "optimiser",
    "effect of the simulator",
)

SECTIONS = re.findall(r"^## \d+\. (.+?)\n(.*?)(?=^## |\Z)", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
IDS = [title for title, _ in SECTIONS]


def files_of(body: str, part: str) -> list[str]:
    """Paths of the list under **Code** or **Proof**."""
    text = body.split(f"**{part}**", 1)[1].split("\n**", 1)[0]
    return re.findall(r"^- `([^`]+)`", text, re.MULTILINE)


def test_the_ten_changes_are_all_there():
    assert len(SECTIONS) == len(CHANGES)
    assert all(change in title for change, title in zip(CHANGES, IDS, strict=True))


@pytest.mark.parametrize("title, body", SECTIONS, ids=IDS)
def test_every_file_exists(title, body):
    code, proof = files_of(body, "Code"), files_of(body, "Proof")
    assert code and proof
    for path in (*code, *proof):
        new = path.startswith("[")
        path = path.strip("[]")
        assert (ROOT / path).is_file() != new, f"{path}: {'exists' if new else 'not found'}"
        assert (ROOT / path).parent.is_dir(), f"{path}: no such folder"


@pytest.mark.parametrize("title, body", SECTIONS, ids=IDS)
def test_four_files_of_code_are_enough_or_a_reason_is_given(title, body):
    code = files_of(body, "Code")
    assert all(path.strip("[]").startswith(PACKAGE) for path in code)
    assert len(code) <= MOST or "*More than four:*" in body, f"{len(code)} files of code and no reason"
