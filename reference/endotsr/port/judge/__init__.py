"""The judge of ports: reads golden cases and the outputs of a port, and returns verdicts.

This package is independent of the method: it imports only NumPy, msgspec and its own modules.
"""
