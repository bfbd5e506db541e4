"""Losses on images, each a forward/reverse pair with its equation.

In: rendered images (3, H, W), not clamped, observed ones in [0, 1], depth (H, W), mask (H, W), True = tissue.
Out: a scalar loss and its gradient with respect to the render. The losses do not depend on Gaussians or files.
"""
