"""Ports: what the author of another implementation uses.

In: arrays by name, from this package or from a port. Out: the error of gradients, and the judgement of golden cases.
Nothing that is trained or rendered for a user depends on this storey.

operations     the registry of every computation             gradcheck  the checker of reverse passes
judge      compares a port with the golden cases, and is independent of the method
contract   the operations of the golden cases            reference  answers them with this package
search     the line of the definition that a port computes

The folder `golden/` of the repository has the cases and the programs that generate them.
"""
