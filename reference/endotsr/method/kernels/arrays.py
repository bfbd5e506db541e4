"""Type aliases for arrays. The alias gives the kind of number; comments and docstrings give the shape."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]
"""Real numbers: float32 in a training run, float64 in a gradient check; the kernels keep the dtype of their input."""

BoolArray = NDArray[np.bool_]
"""Masks; the name of a variable states whether True means tissue, valid or visible."""

IntArray = NDArray[np.integer]
"""Counts, ranks and positions, of any integer width."""

IndexArray = NDArray[np.intp]
"""Indices of frames or Gaussians, in NumPy's index type."""

Array = NDArray[Any]
"""Any dtype: picture files have 8 or 16 bits, floating-point images 32 or 64."""
