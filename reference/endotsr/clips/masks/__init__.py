"""Instrument masks: drawn on a page, carried to all frames, proposed by colour; the command `masks`."""
