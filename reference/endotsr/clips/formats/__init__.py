"""File formats of others: calibrations, trajectories, reconstructions, videos, stacks. From bytes to checked values."""
