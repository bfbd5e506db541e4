"""Adam, schedules, the training loop and checkpoints. No module here reads a file format of sequences."""
