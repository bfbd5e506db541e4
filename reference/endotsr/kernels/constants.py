"""Constants of several rooms: plain floats, each rounded once, to the dtype of the arrays it is combined with."""

Y00 = 0.28209479177387814  # 1 / sqrt(4 pi): the degree-0 spherical harmonic (B4), by which equation (2) is divided
