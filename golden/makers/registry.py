"""The families of golden cases and their contents: cases without answers, wrong ports.

A family module has three names: OPERATIONS (the operations of its cases), cases() and WRONG_PORTS. A wrong port is
defined in the family of the rule that it breaks; if it also spoils cases of later families, it names their operations.
"""

import importlib
from types import ModuleType

from makers.making import Spec
from makers.wrong import WrongPort

FAMILIES = (
    "reading",
    "dictionary",
    "appearance",
    "motion",
    "matern",
    "laplacian",
    "calibration",
    "deformation",
    "adam",
    "masked_l1",
    "masked_ssim",
    "depth",
    "smoothness",
    "exposure",
    "pose",
    "covariance",
    "projection",
    "harmonics",
    "composite",
    "composite_limits",
    "render",
    "schedule",
    "density",
    "initialisation",
    "scene",
    "objective",
    "training",
    "other_settings",
    "extremes",
)


def families() -> list[ModuleType]:
    """The modules of the families, in the order of the method."""
    return [importlib.import_module(f"makers.{name}") for name in FAMILIES]


def all_specs() -> list[Spec]:
    """Every case, in the order of the families. Raises ValueError if two have one name."""
    found = [spec for family in families() for spec in family.cases()]
    names = [spec.name for spec in found]
    if len(set(names)) != len(names):
        raise ValueError("a golden case is named twice")
    return found


def all_wrong_ports() -> dict[str, WrongPort]:
    """Every wrong port by its flag. Raises ValueError if two have one flag."""
    found: dict[str, WrongPort] = {}
    for family in families():
        for wrong_port in family.WRONG_PORTS:
            if wrong_port.flag in found:
                raise ValueError(f"wrong port {wrong_port.flag} is named twice")
            found[wrong_port.flag] = wrong_port
    return found
