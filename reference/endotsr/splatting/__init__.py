"""The rasteriser: camera, covariance, projection, harmonics, binning, compositing; `render` composes them.

Comes in: deformed Gaussians at one instant and a camera. Goes out: colour (3, H, W), depth (H, W, scene
units), opacity (H, W) and, in reverse, gradients to every parameter, the background and the camera pose.
Knows nothing of time, files or the trainer.
"""
