"""Constants shared by several rooms: plain floats, rounded once to the dtype of the arrays they are combined with."""

Y00 = 0.28209479177387814  # 1 / sqrt(4 pi): the degree-0 spherical harmonic (B4), by which equation (2) is divided
