"""Kernel support: compilation, threads, local arrays, the exponential, array types. This room holds no equation."""
