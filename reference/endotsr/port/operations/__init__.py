"""The registry of operations: a wrapper of every computation that is documented, checked and stored in golden cases.

An operation is a function of arrays by name and settings by name (`operation.Operation`). The gradient checks of
`endotsr.port.gradcheck`, the golden cases of `endotsr.port` and the map of the equations take them from `registry`.
Each file has the operations of one part of the method; `requests` converts arrays and settings to the structures of
the package.
"""
