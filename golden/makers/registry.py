"""The families of golden cases with their contents, and what they declare of every operation.

A family is a module of this folder with OPERATIONS (the operations of its cases) and cases(). An operation is declared
in one family, in DECLARED: see `makers.operations`. The mistakes of a family are in a TOML file of the same name, see
`makers.wrong.wrong_ports`. A mistake belongs to the family of the rule that it breaks; if it also affects cases of
other families, it lists their operations, or each of these has an entry with its lines.
"""

import importlib
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

from endotsr.port.contract import all_operations
from makers.making import Spec
from makers.operations import Declared, Judged
from makers.wrong import WrongPort, wrong_ports

HERE = Path(__file__).parent
STATES = re.compile(r"^OPERATIONS\b", re.MULTILINE)


def _found() -> tuple[str, ...]:
    """The families in the order of the first operation that each declares, then those of further cases by name."""
    names = sorted(file.stem for file in HERE.glob("*.py") if STATES.search(file.read_text(encoding="utf-8")))
    place = {name: k for k, name in enumerate(all_operations())}

    def first(family: str) -> int:
        module = importlib.import_module(f"makers.{family}")
        return min((place.get(name, len(place)) for name in getattr(module, "DECLARED", ())), default=len(place))

    return tuple(sorted(names, key=first))


FAMILIES = _found()


def families() -> list[ModuleType]:
    """The modules of the families."""
    return [importlib.import_module(f"makers.{name}") for name in FAMILIES]


def all_specs() -> list[Spec]:
    """Every case, in the order of the families. Raises ValueError for duplicate names."""
    found = [spec for family in families() for spec in family.cases()]
    names = [spec.name for spec in found]
    if len(set(names)) != len(names):
        raise ValueError("a golden case is named twice")
    return found


def all_wrong_ports() -> dict[str, WrongPort]:
    """Every wrong port by its flag; see `wrong_ports`. Raises ValueError for a flag with two titles, or with none."""
    ports = [port for family in FAMILIES for port in wrong_ports(family)]
    found: dict[str, WrongPort] = {}
    for port in sorted(ports, key=lambda port: not port.title):
        first = found.get(port.flag)
        if bool(first) == bool(port.title):
            raise ValueError(f"wrong port {port.flag} is named twice" if first else f"wrong port {port.flag}: no title")
        found[port.flag] = first.joined(port) if first else port
    return found


def all_declared() -> dict[str, Declared]:
    """What the families declare of every operation, in their order.

    Raises: ValueError for an operation that is declared twice.
    """
    found: dict[str, Declared] = {}
    for family in families():
        declared: Mapping[str, Declared] = getattr(family, "DECLARED", {})
        if twice := sorted(declared.keys() & found.keys()):
            raise ValueError(f"{family.__name__}: operation {', '.join(twice)} is declared twice")
        found |= declared
    return found


DECLARED = all_declared()
JUDGED: dict[str, Mapping[str, Judged]] = {name: operation.outputs for name, operation in DECLARED.items()}
