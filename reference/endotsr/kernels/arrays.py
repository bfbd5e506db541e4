"""Names for the array types of annotations. The name gives the kind of number; comments and docstrings the shape."""

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
"""Numbers of frames or Gaussians, as NumPy takes them for an index."""

Array = NDArray[Any]
"""Any dtype: picture files hold 8 or 16 bits, floating images 32 or 64."""
