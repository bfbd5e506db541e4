"""docs/hard_cases.md: the gallery of hard cases."""
