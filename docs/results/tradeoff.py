"""Measure what accuracy costs in time, and write docs/accuracy_against_time.md from it.

    python docs/results/tradeoff.py render [SPLATS.npz ...]    the simulated scene, then trained scenes
    python docs/results/tradeoff.py train SEQUENCE [OPTIONS]   trainings; OPTIONS as of `endotsr tradeoff train`
    python docs/results/tradeoff.py page                       pictures and page once more from the files

Run it while the machine has nothing else to do. `train` goes on where it was interrupted: its file is kept in
docs/_build/tradeoff until the study is complete. A SEQUENCE is an EndoNeRF folder or the word `simulated`.
"""

import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from endotsr.bench.page import replaced
from endotsr.cli.main import main as endotsr
from endotsr.runs.files import replace_file
from endotsr.tradeoff.document import fragments
from endotsr.tradeoff.figures import draw
from endotsr.tradeoff.training_page import draw_training

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "accuracy_against_time.md"
WORK = FOLDER.parent / "_build" / "tradeoff"


def measure(name: str, *words: str) -> None:
    """One scene to docs/results/NAME.json."""
    with tempfile.TemporaryDirectory() as folder:
        if endotsr(["tradeoff", "--out", folder, *words]):
            sys.exit(1)
        shutil.copy(Path(folder) / "tradeoff.json", FOLDER / f"{name}.json")


def train(sequence: str, words: list[str]) -> None:
    """One study of training to docs/results/tradeoff_training_NAME.json."""
    name = Path(sequence).name
    out = WORK / name
    if endotsr(["tradeoff", "train", sequence, "--out", str(out), *words]):
        sys.exit(1)
    shutil.copy(out / "training.json", FOLDER / f"tradeoff_training_{name}.json")
    shutil.rmtree(out)


def read(pattern: str, but: str = "") -> dict[str, dict[str, Any]]:
    """Files by the part of their name that the pattern leaves open."""
    head, tail = pattern.split("*")
    found = [p for p in sorted(FOLDER.glob(pattern)) if not but or not p.name.startswith(but)]
    return {p.name[len(head) : -len(tail)]: json.loads(p.read_text(encoding="utf-8")) for p in found}


def write_page() -> None:
    """All pictures, and the generated parts of the page."""
    result = json.loads((FOLDER / "tradeoff.json").read_text(encoding="utf-8"))
    others = read("tradeoff_*.json", but="tradeoff_training")
    trainings = read("tradeoff_training_*.json")
    draw(result, FOLDER)
    for name, other in others.items():
        draw(other, FOLDER, f"tradeoff_{name}")
    for name, study in trainings.items():
        draw_training(study, FOLDER, f"tradeoff_training_{name}")
    text = replaced(PAGE.read_text(encoding="utf-8"), fragments(result, others, trainings), PAGE, "tradeoff")
    replace_file(PAGE, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def main(words: list[str]) -> None:
    """The command."""
    if words[:1] == ["render"]:
        measure("tradeoff")
        for splats in words[1:]:
            measure(f"tradeoff_{Path(splats).stem.removesuffix('_splats')}", "--splats", splats)
    elif words[:1] == ["train"] and len(words) > 1:
        train(words[1], words[2:])
    elif words != ["page"]:
        sys.exit(__doc__)
    write_page()


if __name__ == "__main__":
    main(sys.argv[1:])
