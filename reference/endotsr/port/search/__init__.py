"""The search for unlisted mistakes: changes of the definition that reproduce the outputs of a port.

In: the report of the judge on refused outputs. Out: changes of the first wrong operation that reproduce the port's
outputs of it, with what they reproduce. Each is a setting or an input read differently, a convention of another
program, or a change in one function or constant of `endotsr.definition`.
"""
