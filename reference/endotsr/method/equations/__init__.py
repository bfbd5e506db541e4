"""The equations of the paper, one per module, independent of scenes, files and the trainer.

In: NumPy arrays, Gaussian index last; time normalised to [0, 1]. Out: values, and saved tuples for the reverse pass,
which follows directly below each forward pass.
"""
