"""The search for unlisted mistakes: single changes of the definition that reproduce the outputs of a port.

In: the report of the judge on refused outputs. Out: changes of one setting, one input or one place in the source of
`endotsr.definition` that reproduce all of the port's outputs of the first wrong operation.
"""
