"""Accuracy against time: errors against the certified exact renderer, beside seconds and visits.

`scenes` are the rendered scenes; `settings` the dials; `measure` gives errors and costs of one setting; `certificate`
verifies the reference; `study` runs the whole measurement; `front` finds the settings that are not dominated; `budget`
chooses among them; `training` does the same for fits; `figures` and `page` present the results.
"""
