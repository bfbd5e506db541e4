"""docs/tradeoff.md: accuracy against time."""
