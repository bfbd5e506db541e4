"""Generators of the golden cases: per family a module with its cases and a TOML file with its wrong ports.

`golden/make.py` is their program. It runs in the repository and is not part of the installed package.
"""
