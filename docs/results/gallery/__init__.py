"""The gallery of hard cases; importing the package fills `registry.CASES`."""

from gallery import rasteriser, spectral
from gallery.registry import CASES, DTYPES, Case

__all__ = ["CASES", "DTYPES", "Case", "rasteriser", "spectral"]
