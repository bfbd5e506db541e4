"""Accuracy against time: errors against the exact renderer, beside seconds and visits.

`scenes` are the rendered scenes; `settings` the measured ones; `measure` gives errors and costs of one setting; `study`
runs the measurement and finds the settings that are not dominated; `budget` chooses among them; `text` puts the results
into words.
"""
