"""docs/claims.md and docs/paper.md: the paper's claims against measured runs."""
