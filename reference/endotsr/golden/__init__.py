"""Golden vectors, against which ports are tested.

`judge` compares the outputs of a port with the golden cases and is independent of the method. `reference` answers the
same cases with the package itself. The programs that make the cases are kept beside them, in the folder `golden/` of
the repository.
"""
