"""Checks of a sequence before a training: everything wrong in one pass, each finding with its remedy."""
