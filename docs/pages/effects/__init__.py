"""docs/effects.md: tests for effects, and what they are worth."""
