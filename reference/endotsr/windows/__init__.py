"""A recording that goes on for minutes, as windows: runs of their own on overlapping parts of it.

survey    one pass over the recording, frame by frame      plan     windows from what the pass has found
record    windows.json                                     make     the windows trained, in the order of their chains
carry     the state of a neighbour as the start of a window
scene     one scene to the outside, blended over overlaps  measure  held-out frames and seams of that scene
follow    points of the tissue across seams                page     the page that loads the window that is played

In: a sequence folder of any length. Out: a run folder with windows/000, windows/001, ..., each of which is a run
folder, and windows.json. A frame of the recording is counted from 0 among the frames that `sequence.frames` selects;
frame g of G has the time g / G. The frames, times and cycles of a window are its own.
"""
