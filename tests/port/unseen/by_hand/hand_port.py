"""The port by hand as text: it is run as it stands, or with one line changed.

It was written from docs/specification alone, in NumPy, with every reverse pass as its formulas. A mistake is an edit of
its text, as an author makes one in an editor: in a forward formula alone, in a reverse formula alone, or in both.
"""

import types
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
FILES = ("hand_time", "hand_losses", "hand_screen", "hand_pair", "hand_rules")
OPERATIONS = (
    "reading", "generator", "frequencies", "dictionary", "atoms", "appearance", "motion", "matern", "deformation",
    "scene", "exposure", "pose", "masked_l1", "masked_ssim", "normalised_depth", "smoothness", "laplacian",
    "covariance", "projection", "harmonics", "composite", "render", "calibration", "adam", "schedule", "density",
    "initialisation", "registration",
)  # fmt: skip


def sources(edits=()):
    """The text of every file, with the edits (old, new); each old text stands in the port exactly once."""
    texts = {name: (HERE / f"{name}.py").read_text(encoding="utf-8") for name in FILES}
    for old, new in edits:
        places = [name for name, text in texts.items() for _ in range(text.count(old))]
        if len(places) != 1:
            raise ValueError(f"{len(places)} places in the port by hand, where 1 is expected: {old!r}")
        texts[places[0]] = texts[places[0]].replace(old, new)
    return texts


def operations(edits=()):
    """The functions of the port by operation."""
    modules: dict[str, types.ModuleType] = {}
    found = {}
    for name, text in sources(edits).items():
        module = types.ModuleType(name)
        lines = text.splitlines(keepends=True)
        for other in modules:
            lines = [line for line in lines if not line.startswith(f"from {other} import")]
            wanted = [line for line in text.splitlines() if line.startswith(f"from {other} import")]
            for line in wanted:
                for imported in line.split("import", 1)[1].split(","):
                    setattr(module, imported.strip(), getattr(modules[other], imported.strip()))
        exec(compile("".join(lines), f"{name}.py", "exec"), module.__dict__)
        modules[name] = module
        found |= {operation: getattr(module, operation) for operation in OPERATIONS if hasattr(module, operation)}
    return found


def answer(port, operation, inputs, settings):
    """Outputs of a case by name."""
    with np.errstate(all="ignore"):
        return {name: np.array(value, order="C") for name, value in port[operation](inputs, settings).items()}
