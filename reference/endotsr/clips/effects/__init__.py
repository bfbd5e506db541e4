"""Tests for effects in a clip, and a plan of the components that model them.

In: a `Sequence`, of which only training frames are read. Out: one `EffectVerdict` for each effect (statistic,
threshold, false-positive rate, reason) and a `Plan` (settings to change, reasons, expected savings). This room does not
depend on the trainer: a plan only changes the configuration.
"""
