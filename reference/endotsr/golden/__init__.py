"""The conformance target of ports.

`judge` compares the outputs of a port with the golden cases and knows nothing of how those are made. `vectors` makes
them: one module a family, with its cases and the mistakes that they reveal.
"""
