"""Adam, schedules, the training loop and checkpoints. Knows no file format of sequences."""
