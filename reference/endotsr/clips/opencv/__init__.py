"""The room that works with OpenCV.

    png, pictures                  files: PNG alone, and every kind of picture
    picture_marks, other_kinds     what a file states about its pixels, and pictures that are not RGB of 8 bits
    filters, regions               edges, blur and resizing; growing, shrinking and outlines of masks
    flow, geometry, stereo         motion between pictures, poses and features, pairs of views
    library                        the import of `cv2`

Inputs and outputs are NumPy arrays in this project's conventions (RGB order, planar flow). OpenCV's own conventions
(BGR, interleaved flow, one-dimensional arrays that differ between versions 4 and 5) do not leave this room. `library`
imports `cv2` on first use: commands that read no picture start without it. Golden vectors depend on this room only
through the Canny edges, an input of the smoothness loss.
"""
