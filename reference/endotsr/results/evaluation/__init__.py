"""Metrics, LPIPS, image-space baselines, evaluation protocol and comparison of methods."""
