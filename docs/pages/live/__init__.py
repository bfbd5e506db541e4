"""Chapters that run in their page: what they import there, and the files that the page reads."""
