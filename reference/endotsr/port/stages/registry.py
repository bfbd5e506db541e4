"""The list of all stages. `tests/test_conventions.py` asserts that no `<stage>_forward` of the package is missing."""

import importlib

from endotsr.port.stages.stage import Stage

STAGE_MODULES = (
    "spectral", "laplacian", "deformation", "projection", "compositing", "losses", "exposure", "pose",
    "registration", "scene", "optimiser",
)  # fmt: skip


def all_stages() -> dict[str, Stage]:
    """Every stage by name, in the order of the specification.

    Raises: ValueError if two stages, or two of their variants, have the same name.
    """
    stages: list[Stage] = []
    for module in STAGE_MODULES:
        stages += importlib.import_module(f"endotsr.port.stages.{module}").STAGES
    for kind, names in (
        ("stage", [stage.name for stage in stages]),
        ("variant", [variant.name for stage in stages for variant in stage.variants]),
    ):
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"{kind} {', '.join(twice)} is registered twice")
    return {stage.name: stage for stage in stages}
