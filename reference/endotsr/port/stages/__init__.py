"""The registry of stages: a wrapper of every computation that is documented, checked and stored in golden cases.

A stage is a function of arrays by name and settings by name (`stage.Stage`). The gradient checks of
`endotsr.port.gradcheck`, the golden cases of `endotsr.port` and the map of the equations use `registry.all_stages`.
Each file has the stages of one part of the method; `requests` converts arrays and settings to the structures of the
package.
"""
