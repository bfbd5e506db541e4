"""Metrics, LPIPS, image-space baselines, protocols and reports."""
