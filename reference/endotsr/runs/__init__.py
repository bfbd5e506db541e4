"""Run folders: their files, the sequence and the model that they remember."""
