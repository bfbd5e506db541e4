"""Benchmarks on a fixed workload, which is the same for every version of the software and for every peer."""
