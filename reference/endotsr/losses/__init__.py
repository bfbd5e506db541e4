"""Base losses on images: masked L1, masked SSIM, normalised depth, smoothness. Each is a forward/reverse pair.

Input: rendered and observed images (3, H, W) in [0, 1], depth (H, W), mask (H, W), True = tissue.
Output: a scalar loss and its gradient with respect to the render. The room does not depend on Gaussians or files.
"""
