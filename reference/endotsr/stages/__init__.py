"""The registry of stages: every computation that is documented, checked and stored is wrapped here once.

A stage is a function of arrays by name and settings by name (`stage.Stage`). `registry.all_stages` drives the gradient
checks of `endotsr.gradcheck`, the golden cases of `endotsr.golden` and the map of the equations. A file holds the
stages of one part of the method; `requests` turns arrays and settings into the structures of the package.
"""
