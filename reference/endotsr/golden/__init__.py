"""Golden vectors for testing ports.

`judge` compares the outputs of a port with the golden cases and is independent of the method. `reference` answers the
same cases with the package itself. The folder `golden/` of the repository has the cases and the programs that generate
them.
"""
