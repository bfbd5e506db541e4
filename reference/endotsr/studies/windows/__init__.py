"""Recordings of several minutes, trained as overlapping windows. Each window is a run.

survey    one pass over the recording, frame by frame      plan     windows from the surveyed frames
record    windows.json                                     make     trains the windows, chain by chain
carry     warm start of a window from its neighbour
scene     all windows as one scene, blended in overlaps    measure  held-out metrics and flicker at seams
follow    tissue points tracked across seams               page     viewer page, one script file per window

In: a sequence folder of any length. Out: a run folder with windows.json and windows/000, windows/001, ..., each a run
folder. Frames of the recording count from 0 among the frames that `sequence.frames` selects; frame g of G has time
g / G. Each window has its own frame numbers, times and Fourier cycles.
"""
