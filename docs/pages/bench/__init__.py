"""docs/bench.md: time by stage, peers, start, scale."""
