"""Base losses on images: masked L1, masked SSIM, normalised depth, smoothness. Each a forward/reverse pair.

Comes in: rendered and observed images (3, H, W) in [0, 1], depth (H, W), mask (H, W) True on tissue.
Goes out: a scalar loss and its gradient by the render. Knows nothing of Gaussians or files.
"""
