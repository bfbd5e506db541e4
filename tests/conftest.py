"""Shared fixtures; makes the helpers of the tests folder importable."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE / "splatting")]  # made_up_scenes is used in other folders too
