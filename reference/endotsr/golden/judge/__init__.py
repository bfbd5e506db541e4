"""The judge of ports: reads golden cases and the outputs of a port, and answers with verdicts.

Nothing in this room knows the method: it imports NumPy, msgspec and its own modules only.
"""
