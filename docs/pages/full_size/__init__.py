"""docs/full_size.md and docs/results: runs at full size."""
