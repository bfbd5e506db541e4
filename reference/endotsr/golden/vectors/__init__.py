"""Makers of the golden cases: one module a family, which holds its cases and its wrong ports."""
