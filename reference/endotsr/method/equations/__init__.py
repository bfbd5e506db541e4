"""Equations (1) to (5) and (7) of the paper, and (B1), (B13) and (B16), independent of scenes, files and the trainer.

In: NumPy arrays, Gaussian index last; time normalised to [0, 1). Out: values, and saved tuples for the reverse pass,
which follows directly below each forward pass.
"""
