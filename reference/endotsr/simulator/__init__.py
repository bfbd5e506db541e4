"""Sequences with known truth (geometry, motion, light, masks, depth), each effect a separate switch."""
