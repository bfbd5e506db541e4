"""What a clip calls for: tests of effects, and a plan of the components that answer them.

In: a `Sequence`; only its training frames are read. Out: one `Verdict` for each effect (statistic, threshold,
false-positive rate, reason) and a `Plan` (which settings to change, why, and the expected saving). This room does not
depend on the trainer: a plan is a change of the configuration and nothing else.
"""
