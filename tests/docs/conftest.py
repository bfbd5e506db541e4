"""The extensions of the book, as Sphinx has them, and the makers of its pages are importable."""

import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
sys.path[:0] = [str(DOCS / "_extensions"), str(DOCS)]
