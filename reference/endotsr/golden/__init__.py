"""Golden vectors, against which ports are tested.

`judge` compares the outputs of a port with the golden cases and is independent of how those are made. `vectors` makes
them, in one module a family, with its cases and the mistakes that they reveal.
"""
