"""Makers of the golden cases: one module a family, with its cases, and beside it a file with its wrong ports.

`golden/make.py` is their program. It runs in the repository and is no part of the installed package.
"""
