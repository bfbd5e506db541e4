"""What a chapter imports when it runs in its page: plain NumPy in the place of compiled modules.

This file runs in the browser, beside the modules that `bundle.py` lists. `HOMES` says for each name of a compiled
module which function of `endotsr.definition` has its place; a name without a home, and a module without names, is
refused with a sentence. The modules that exist as files come first, so that nothing else is replaced.
"""

import contextlib
import importlib
import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec

from pages.live import helpers

# Compiled module -> module of the definition -> names.
HOMES = {
    "endotsr.method.equations.dictionary": {
        "dictionary": "frequencies dictionary_forward dictionary_reverse atom_statistics normalise_forward "
        "normalise_reverse normalised_atoms"
    },
    "endotsr.method.equations.appearance": {"appearance": "Y00 appearance_forward appearance_reverse"},
    "endotsr.method.equations.motion": {"motion": "motion_forward motion_reverse"},
    "endotsr.method.equations.matern": {"matern": "matern_weights matern_penalty_forward matern_penalty_reverse"},
    "endotsr.method.equations.deformation": {"deformation": "deformation_forward deformation_reverse"},
    "endotsr.method.equations.laplacian": {
        "laplacian": "SupportMasks laplacian_levels laplacian_loss_forward laplacian_loss_reverse support_masks"
    },
    "endotsr.method.equations.calibration": {"calibration": "calibrate rms"},
    "endotsr.method.equations.pose": {"pose": "pose_forward pose_reverse"},
    "endotsr.method.splatting.camera": {"projection": "Camera"},
    "endotsr.method.splatting.covariance": {
        "covariance": "Shape covariance_forward covariance_matrix covariance_reverse"
    },
    "endotsr.method.splatting.harmonics": {"harmonics": "HarmonicsSaved harmonics_forward harmonics_reverse"},
    "endotsr.method.splatting.projection": {"projection": "Projected ProjectionSaved"},
    "endotsr.method.splatting.render": {"render": "Scene"},
    "endotsr.method.splatting.settings": {"settings": "EXACT PAPER LegacyDeviations RasterSettings"},
    "endotsr.training.fitting.model": {"scene": "Spectral spectral_from"},
    "endotsr.training.scene.gaussians": {"scene": "Gaussians"},
}
# The modules of `endotsr.port.operations` with the gradient checks of the chapters that run.
OPERATIONS = ("spectral", "laplacian", "deformation", "projection", "pose")
# Compiled module -> names that are written in `helpers`, and constants.
OWN = {
    "endotsr.config": {"Config": object, "config_from_dict": helpers.sections},
    "endotsr.clips.simulator": {"SimulatorSettings": dict, "simulate": helpers.simulated},
    "endotsr.method.equations.deformation": {"CHANNELS": 10, "Basis": str},
    "endotsr.method.equations.pyramid": {"Upsampling": str},
    "endotsr.method.equations.dictionary": {"report_atoms": helpers.report_atoms},
    "endotsr.method.splatting.projection": {
        name: getattr(helpers, name)
        for name in ("projection_forward", "projection_reverse", "projection_reverse_footprint")
    },
    "endotsr.port.operations.requests": {
        name: getattr(helpers, name) for name in ("camera_of", "raster_dict", "raster_of")
    },
}


class Homes(MetaPathFinder, Loader):
    """Finds the modules of `HOMES`, their packages, and refuses all other modules of the package."""

    def __init__(self):
        self.names = {*HOMES, *OWN}
        self.packages = {".".join(name.split(".")[:k]) for name in self.names for k in range(1, name.count(".") + 1)}

    def find_spec(self, name, path=None, target=None):
        """Called last by the import system, for a module without a file."""
        if name in self.names or name in self.packages:
            return ModuleSpec(name, self, is_package=name in self.packages)
        if name.split(".")[0] == "endotsr":
            raise ModuleNotFoundError(f"{name} is compiled or needs a compiled module; it does not run in the page")
        return None

    def create_module(self, spec):
        """The default module."""

    def exec_module(self, module):
        """Fill a module with the functions of the definition."""
        vars(module).update(OWN.get(module.__name__, {}))
        for home, names in HOMES.get(module.__name__, {}).items():
            definition = importlib.import_module(f"endotsr.definition.{home}")
            vars(module).update({name: getattr(definition, name) for name in names.split()})

        def absent(name):
            if name.startswith("__"):
                raise AttributeError(name)
            raise ImportError(f"{module.__name__}.{name} is compiled and has no place in the definition")

        if module.__name__ in self.names:
            module.__getattr__ = absent


def install():
    """Import compiled modules from the table from now on, and check gradients on one thread."""
    sys.meta_path.append(Homes())
    replaced = {"gradcheck": {"one_thread": contextlib.nullcontext}, "operations.registry": {"MODULES": OPERATIONS}}
    for name, values in replaced.items():
        vars(importlib.import_module(f"endotsr.port.{name}")).update(values)
    # The signs of (5) are decisions of the forward pass. The definition saves them with their weight.
    saved = importlib.import_module("endotsr.definition.laplacian").LaplacianSaved
    saved.signs = property(lambda self: [(slope > 0).astype(int) - (slope < 0) for slope in self.slopes])
