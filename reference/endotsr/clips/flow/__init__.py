"""Optical flow of a clip: its pairs, chained tracks, and the frames between two frames."""
