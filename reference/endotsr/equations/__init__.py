"""The equations of the paper, one per module. The room does not depend on scenes, files or the trainer.

Input: NumPy arrays, Gaussian index last; time normalised to [0, 1]. Output: values, and saved tuples for the reverse
pass, which stands directly below each forward pass.
"""
