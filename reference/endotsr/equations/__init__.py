"""The paper, one equation a module, in its order. Knows nothing of scenes, files or the trainer.

Comes in: NumPy arrays, Gaussian index last, time normalised to [0, 1]. Goes out: values and saved tuples
for the reverse pass directly below each forward pass.
"""
