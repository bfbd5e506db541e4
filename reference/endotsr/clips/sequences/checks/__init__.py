"""Checks of a sequence before training: all faults in one pass, each finding with its remedy."""
