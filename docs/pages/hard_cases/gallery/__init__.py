"""The gallery of hard cases; importing the package fills `registry.CASES`."""

from pages.hard_cases.gallery import rasteriser, spectral
from pages.hard_cases.gallery.registry import CASES, DTYPES, Case

__all__ = ["CASES", "DTYPES", "Case", "rasteriser", "spectral"]
