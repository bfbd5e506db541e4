"""Benchmarks on a fixed workload, common to all versions of the software and to peers."""
