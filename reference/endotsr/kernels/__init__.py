"""Kernel support: how a kernel is compiled, shared among threads and given registers. Knows no equation."""
