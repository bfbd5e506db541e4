"""Adam, schedules, the training loop and checkpoints, independent of the file formats of sequences."""
