"""The rasteriser: camera, covariance, projection, harmonics, binning, compositing; `render` composes them.

In: deformed Gaussians at one time, and a camera. Out: colour (3, H, W), depth (H, W, scene units), opacity (H, W) and,
in reverse, gradients with respect to every parameter, the background and the camera pose. The rasteriser does not
depend on time, files or the trainer. `registration` (B19) shares its camera and is no part of a view.
"""
