"""Kernel support: compilation, threads, local arrays, the exponential, array types. No equation is implemented here."""
