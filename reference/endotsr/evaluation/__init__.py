"""Metrics, LPIPS, image-space baselines, and the evaluation protocol."""
