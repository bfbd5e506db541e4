"""The extensions of the book are importable, as Sphinx has them; `pages` is, by the conftest of all tests."""

import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "_extensions"))
