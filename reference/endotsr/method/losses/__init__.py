"""Base losses on images: masked L1, masked SSIM, normalised depth, smoothness. Each is a forward/reverse pair.

In: rendered images (3, H, W), not clamped, observed ones in [0, 1], depth (H, W), mask (H, W), True = tissue.
Out: a scalar loss and its gradient with respect to the render. The losses do not depend on Gaussians or files.
"""
