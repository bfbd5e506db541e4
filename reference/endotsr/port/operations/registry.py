"""The list of all operations; `tests/test_conventions.py` asserts that it lacks no `<operation>_forward`."""

import importlib

from endotsr.port.operations.operation import Operation

MODULES = (
    "spectral", "laplacian", "deformation", "projection", "compositing", "losses", "exposure", "pose",
    "registration", "scene", "optimiser",
)  # fmt: skip


def method_operations() -> dict[str, Operation]:
    """Every operation by name, in the order of the specification.

    Raises: ValueError if two operations, or two of their variants, have the same name.
    """
    operations: list[Operation] = []
    for module in MODULES:
        operations += importlib.import_module(f"endotsr.port.operations.{module}").OPERATIONS
    for kind, names in (
        ("operation", [operation.name for operation in operations]),
        ("variant", [variant.name for operation in operations for variant in operation.variants]),
    ):
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"{kind} {', '.join(twice)} is registered twice")
    return {operation.name: operation for operation in operations}
