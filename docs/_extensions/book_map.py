"""The map of the book: for each equation its functions, reverse pass, gradient check, golden cases and notebooks.

Everything is read from the registry of operations, `golden/cases` and the notebooks. Only information without an
operation is here: the functions of equations without a derivative, the reason, and the tests that check them instead.
"""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from package_names import NOTEBOOKS, ROOT, equation_pages, markdown_of, notebooks_of

from endotsr.port.gradcheck import Pair, all_pairs

GOLDEN = ROOT / "golden"
# Displays that are parts of another equation: the blend and the recursion of compositing.
PARTS = {"b5b": "b5", "b5c": "b5"}


class Undifferentiated(NamedTuple):
    """An equation without a reverse pass."""

    functions: tuple[str, ...]
    reason: str  # why there is no reverse pass
    tests: str  # tests that check it instead
    golden: str = ""  # family of golden cases that contains it, or the reason for none; "" = its own family
    notebook: str = ""  # the reason if no notebook announces it; "" = one does


UNDIFFERENTIATED = {
    "7": Undifferentiated(
        ("endotsr.method.equations.calibration.calibrate", "endotsr.training.fitting.objective.calibrate_on"),
        "the weight is held fixed",
        "tests/method/equations/test_calibration.py",
    ),
    "b10": Undifferentiated(
        ("endotsr.training.fitting.adam.adam_step", "endotsr.training.fitting.schedules.learning_rates"),
        "a step is not differentiated",
        "tests/training/fitting/test_adam.py",
    ),
    "b11": Undifferentiated(
        ("endotsr.training.scene.density_control.gather_statistics", "endotsr.training.scene.density_control.densify"),
        "choosing Gaussians is not differentiable",
        "tests/training/scene/test_density_control.py",
    ),
    "b12": Undifferentiated(
        ("endotsr.training.scene.initialisation.initialise",),
        "it comes before training",
        "tests/training/scene/test_initialisation.py",
    ),
    "b14": Undifferentiated(
        ("endotsr.clips.flow.between.frame_between", "endotsr.clips.flow.between.motion_between"),
        "a target is held fixed",
        "tests/clips/flow/test_between.py",
        "none: dense optical flow is an estimate, and a port may take any",
    ),
    "b15": Undifferentiated(
        ("endotsr.clips.flow.tracks.follow", "endotsr.training.scene.tracked_motion.with_tracked_motion"),
        "it comes before training",
        "tests/training/scene/test_tracked_motion.py",
        "none: dense optical flow is an estimate, and a port may take any",
    ),
    "b17": Undifferentiated(
        ("endotsr.training.fitting.coarse_start.coarse_ends", "endotsr.clips.sequences.smaller.halved"),
        "the choice of the frames is held fixed",
        "tests/training/fitting/test_coarse_start.py",
        "none: it is an option of training that is not part of the paper",
    ),
    "b18": Undifferentiated(
        ("endotsr.studies.windows.plan.planned_windows",),
        "windows are chosen before training",
        "tests/studies/windows/test_windows_plan.py",
        "none: windows are an option of training that is not part of the paper",
        "none: the guide to recordings shows one",
    ),
    "b18b": Undifferentiated(
        ("endotsr.studies.windows.scene.blended",),
        "it comes after training",
        "tests/studies/windows/test_scene.py",
        "none: windows are an option of training that is not part of the paper",
    ),
    "b18c": Undifferentiated(
        ("endotsr.studies.windows.carry.carried_state",),
        "it comes before training",
        "tests/studies/windows/test_carry.py",
        "none: windows are an option of training that is not part of the paper",
    ),
    "b18d": Undifferentiated(
        ("endotsr.studies.windows.follow.followed",),
        "it comes after training",
        "tests/studies/windows/test_follow.py",
        "none: windows are an option of training that is not part of the paper",
        "none: the guide to recordings shows one",
    ),
    "b19b": Undifferentiated(
        ("endotsr.clips.poses.chain.chained", "endotsr.clips.poses.bundle.adjusted"),
        "it comes before training",
        "tests/clips/poses/test_bundle.py",
        "none: poses are an estimate, and a port takes those of the clip",
    ),
    "m1": Undifferentiated(
        ("endotsr.results.evaluation.metrics.psnr", "endotsr.results.evaluation.metrics.psnr_tissue"),
        "a metric is only reported",
        "tests/results/evaluation/test_metrics.py",
        "none: a port is judged by its renders",
    ),
    "m2": Undifferentiated(
        ("endotsr.results.evaluation.metrics.ssim_full", "endotsr.results.evaluation.metrics.ssim_tissue"),
        "a metric is only reported",
        "tests/results/evaluation/test_metrics.py",
        "none: it uses the map of (B7), which has cases",
    ),
    "m3": Undifferentiated(
        ("endotsr.results.evaluation.lpips.lpips",),
        "a metric is only reported",
        "tests/results/evaluation/test_lpips.py",
        "none: it needs a file of weights",
        "none: it needs a file of weights",
    ),
}
# Reverse functions whose name does not follow from the forward function's.
REVERSE_OF = {"endotsr.training.fitting.objective.image_loss": "endotsr.training.fitting.objective.image_loss"}


class Equation(NamedTuple):
    """One row of the map. Every tuple is non-empty, or its absence has a reason."""

    label: str
    page: str
    functions: tuple[str, ...]
    reverses: tuple[str, ...]
    pairs: tuple[Pair, ...]
    golden: tuple[str, ...]  # families
    notebooks: tuple[str, ...]
    without: Undifferentiated | None

    @property
    def number(self) -> str:
        return f"({self.label[0].upper()}{self.label[1:]})"


@cache
def golden_cases() -> dict[str, list[dict[str, Any]]]:
    """Family -> its cases as stored, in the order of the manifest."""
    families = json.loads((GOLDEN / "manifest.json").read_text(encoding="utf-8"))["families"]
    path = lambda family, case: GOLDEN / "cases" / family / case / "case.json"
    return {
        family: [json.loads(path(family, case).read_text(encoding="utf-8")) for case in cases]
        for family, cases in families.items()
    }


def families_of(label: str) -> tuple[str, ...]:
    """Families made for the equation; without one, the declared family that contains it."""
    own = tuple(name for name, cases in golden_cases().items() if cases[0]["equation"].lower() == label)
    declared = UNDIFFERENTIATED[label].golden if label in UNDIFFERENTIATED else ""
    return own or ((declared,) if declared in golden_cases() else ())


def reverse_of(forward: str) -> str:
    return REVERSE_OF.get(forward, re.sub("_forward$", "_reverse", forward))


@cache
def equations() -> tuple[Equation, ...]:
    """All equations of the specification, in its order."""
    rows = []
    for label, page in equation_pages().items():
        if label in PARTS:
            continue
        pairs = tuple(pair for pair in all_pairs().values() if pair.equation.lower() == label)
        without = UNDIFFERENTIATED.get(label)
        functions = without.functions if without else tuple(dict.fromkeys(pair.function for pair in pairs))
        reverses = () if without else tuple(reverse_of(name) for name in functions)
        rows.append(Equation(label, page, functions, reverses, pairs, families_of(label), notebooks_of(label), without))
    return tuple(rows)


def has_derivation(notebook: str) -> bool:
    return "\n## The reverse pass" in markdown_of(NOTEBOOKS / f"{notebook}.py")


def names_of_tests(file: str) -> list[str]:
    return re.findall(r"^def (test_\w+)", Path(ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
