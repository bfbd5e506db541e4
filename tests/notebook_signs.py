"""Flip every sign of every transcription in the notebooks, one at a time: each must make an assertion fail.

Run by hand (minutes): python tests/notebook_signs.py [name of a notebook ...]
Cells that only check gradients are left out, and cells that only draw are run for survivors only.
"""

import ast
import contextlib
import io
import os
import random
import re
import sys
import time
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("ENDOTSR_NOTEBOOK_SIZE", "small")

FOLDER = Path(__file__).parents[1] / "notebooks"
sys.path.append(str(FOLDER))  # of the module `running_clip`
Sign = tuple[int, int]  # cell, position in the walk of its syntax tree


def code_cells(file: Path) -> list[tuple[bool, str]]:
    """(is a transcription, source) of every code cell."""
    parts = re.split(r"^# %%(.*)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    pairs = zip(parts[0::2], parts[1::2])
    return [("transcription" in head, body) for head, body in pairs if "[markdown]" not in head]


def signs_of(source: str) -> list[int]:
    """Places of the walk with a plus or a minus between numbers; subscripts, shapes and axes are no formula."""
    tree = ast.parse(source)
    index_nodes = {id(n) for s in ast.walk(tree) if isinstance(s, ast.Subscript) for n in ast.walk(s.slice)}
    ranges = [
        n for n in ast.walk(tree) if isinstance(n, ast.Call) and ast.unparse(n.func) in ("range", "np.zeros", "np.ones")
    ]
    index_nodes |= {id(n) for call in ranges for a in call.args for n in ast.walk(a)}
    found = []
    for place, node in enumerate(ast.walk(tree)):
        binary = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub)
        augmented = isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add | ast.Sub)
        unary = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
        if (binary or augmented or unary) and id(node) not in index_nodes:
            found.append(place)
    return found


def flipped(source: str, place: int) -> tuple[str, str]:
    """(source with one sign flipped, the line it is on)."""
    tree = ast.parse(source)
    node = list(ast.walk(tree))[place]
    if isinstance(node, ast.UnaryOp):
        node.op = ast.UAdd()
    elif isinstance(node, ast.BinOp | ast.AugAssign):
        node.op = ast.Sub() if isinstance(node.op, ast.Add) else ast.Add()
    return ast.unparse(tree), source.splitlines()[node.lineno - 1].strip()  # pyright: ignore[reportAttributeAccessIssue]


def fails(cells: list[str]) -> bool:
    """Whether running the cells in order raises."""
    import matplotlib.pyplot as plt

    names: dict[str, object] = {"__name__": "__main__"}
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            for source in cells:
                exec(compile(source, "notebook", "exec"), names)
    except Exception:
        return True
    finally:
        plt.close("all")
    return False


def parts(file: Path) -> tuple[list[bool], list[bool]]:
    """For every code cell: does it more than check gradients, and does it only draw?"""
    bodies = [body for _, body in code_cells(file)]
    kept = [not re.search(r"check_pair\(|check_function\(", body) for body in bodies]
    return kept, ["plt.subplots" in body or "plt.figure" in body for body in bodies]


def notebook_fails(file: Path) -> bool:
    """Whether a notebook fails, first without its gradient checks and pictures, then as a whole."""
    cells = [body for _, body in code_cells(file)]
    lean = [body for body, keep, draw in zip(cells, *parts(file)) if keep and not draw]
    return fails(lean) or fails(cells)


def a_flip_is_noticed(file: Path, seed: int = 0) -> tuple[bool, str]:
    """One sign of the transcriptions, the same each time: (was its flip noticed, its line)."""
    cells = code_cells(file)
    places = [(k, place) for k, (formula, body) in enumerate(cells) if formula for place in signs_of(body)]
    number, place = random.Random(f"{file.stem} {seed}").choice(places)
    source, line = flipped(cells[number][1], place)
    kept, draws = parts(file)
    changed = [source if k == number else body for k, (_, body) in enumerate(cells)]
    return fails([text for text, keep, draw in zip(changed, kept, draws) if keep and not draw]), line


def survivors(file: Path) -> tuple[int, list[str]]:
    """(number of flips, those that nothing noticed)."""
    cells = code_cells(file)
    kept, draws = parts(file)
    assert not fails([body for (_, body), keep in zip(cells, kept) if keep]), f"{file.name} fails unchanged"
    count, alive = 0, []
    for number, (formula, body) in enumerate(cells):
        for place in signs_of(body) if formula else []:
            source, line = flipped(body, place)
            changed = [source if k == number else text for k, (_, text) in enumerate(cells)]
            count += 1
            lean = [text for text, keep, draw in zip(changed, kept, draws) if keep and not draw]
            full = [text for text, keep in zip(changed, kept) if keep]
            if not fails(lean) and not fails(full):
                alive.append(line)
    return count, alive


def report(name: str, count: int, alive: list[str], start: float) -> bool:
    """Print how many of `count` flips were noticed since `start`, and those that were not; whether there are such."""
    print(f"{name}: {count} signs, {len(alive)} unnoticed, {time.perf_counter() - start:.0f} s", flush=True)
    for line in alive:
        print(f"    {line}", flush=True)
    return bool(alive)


def main(names: list[str]) -> int:
    """Print what survived; the exit status is the number of notebooks with survivors."""
    bad = 0
    for file in sorted(FOLDER.glob("*.py")):
        if names and file.stem not in names:
            continue
        start = time.perf_counter()
        count, alive = survivors(file)
        bad += report(file.stem, count, alive, start)
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
