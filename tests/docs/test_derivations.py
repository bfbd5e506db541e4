"""Derivations are numbered without gaps, and the code of the definition cites the steps that it computes."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "reference/endotsr"
OPTIONS = (
    "clips/flow/between",
    "clips/flow/between_kernels",
    "clips/flow/tracks",
    "clips/sequences/smaller",
    "training/scene/tracked_motion",
    "training/fitting/coarse_start",
    "studies/windows/scene",
    "studies/windows/carry",
    "clips/poses/steps",
    "clips/poses/pair_kernels",
)
FILES = [*sorted((SOURCE / "definition").glob("*.py")), *(SOURCE / f"{name}.py" for name in OPTIONS)]
DEFINITION = "\n".join(file.read_text("utf-8") for file in FILES)
NOTEBOOKS = {int(f.stem[:2]): f.read_text("utf-8") for f in sorted((ROOT / "notebooks").glob("*.py"))}
STEP = re.compile(r"^# \*\*\((\d+)\.(\d+)\)", re.MULTILINE)
CITATION = re.compile(r"\((\d+)\.(\d+)\)")
DERIVED = [*range(1, 14), *range(18, 23)]
NO_LINE = {
    (2, 2): "says what follows from (2.1)",
    (2, 4): "of the kernel alone: the definition divides by the square of the hyperbolic cosine",
    (2, 7): "says what (2.3) and (2.5) give at the start",
    (5, 1): "states the prior of (5.2)",
    (6, 7): "says why two forms agree",
    (7, 5): "of the kernel alone: the definition does not go through the footprint",
    (7, 13): "of the kernel alone: the definition has the exponential of a block matrix",
    (9, 2): "leads to (9.3)",
    (9, 4): "is (9.3) with another factor",
    (9, 8): "the definition differentiates with respect to the covariance in one step",
    (11, 2): "names what depends on the render",
    (11, 3): "leads to (11.4) to (11.6)",
    (12, 1): "states what (12.2) and (12.3) compare",
    (12, 5): "says what (11.1) gives for a whole view",
    (13, 3): "says what (13.2) gives for the first step",
    (13, 4): "says what follows from (13.2)",
    (13, 9): "says what follows from (13.8)",
    (13, 10): "says what (13.8) leaves unchanged",
    (19, 6): "leads to (19.7)",
    (20, 2): "says what follows from (20.1)",
    (21, 2): "says what follows from (21.1)",
    (21, 3): "says what the blend does to independent errors",
    (22, 7): "says what no picture tells",
}


@pytest.mark.parametrize("chapter", DERIVED)
def test_steps_are_numbered_without_gaps(chapter):
    steps = [(int(a), int(b)) for a, b in STEP.findall(NOTEBOOKS[chapter])]
    wrong = [place for k, place in enumerate(steps, start=1) if place != (chapter, k)]
    assert not wrong, f"({chapter}.{wrong[0][1]}) is out of order: number the steps in the order of the text"
    assert len(steps) >= 6


def test_only_derivations_have_numbers():
    assert [chapter for chapter, text in NOTEBOOKS.items() if STEP.search(text)] == DERIVED


def test_every_citation_has_its_step():
    steps = {(int(a), int(b)) for text in NOTEBOOKS.values() for a, b in STEP.findall(text)}
    comments = "\n".join(line.partition("#")[2] for line in DEFINITION.splitlines())
    cited = {(int(a), int(b)) for a, b in CITATION.findall(comments)}
    for chapter in DERIVED:  # a chapter cites its own steps and those of others
        words = "\n".join(line.partition("#")[2] for line in NOTEBOOKS[chapter].splitlines())
        cited |= {(int(a), int(b)) for a, b in CITATION.findall(words) if int(a) in DERIVED}
    assert cited <= steps, f"no such step: {sorted(cited - steps)}"


def test_every_step_is_cited_beside_its_line_of_the_definition():
    steps = {(int(a), int(b)) for text in NOTEBOOKS.values() for a, b in STEP.findall(text)}
    lines = [line.partition("#") for line in DEFINITION.splitlines()]
    cited = {(int(a), int(b)) for code, _, comment in lines if code.strip() for a, b in CITATION.findall(comment)}
    assert steps - cited == set(NO_LINE)
