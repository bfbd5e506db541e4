"""The rasteriser: camera, covariance, projection, harmonics, binning, compositing; `render` composes them.

Input: deformed Gaussians at one time, and a camera. Output: colour (3, H, W), depth (H, W, scene units), opacity (H, W)
and, in reverse, gradients with respect to every parameter, the background and the camera pose. The room does not
depend on time, files or the trainer.
"""
