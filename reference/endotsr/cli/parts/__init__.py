"""Helpers of several commands: options, progress, stop signals."""
