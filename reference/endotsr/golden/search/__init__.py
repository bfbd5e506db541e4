"""The search for a mistake that is on no list: single changes of the definition that give the outputs of a port.

In: the report of the judge on refused outputs. Out: changes of one setting, one input or one place in the source of
`endotsr.definition` with which it gives every output of the first wrong operation as the port wrote it.
"""
