"""A trained scene as files for other programs, and as one small file of its own.

ply      the standard file of 3-D Gaussian splatting, at one time; point clouds     model    the slim model
mesh     the visible surface at one time, from rendered depth
scene    what rendering needs, opened from a run folder, a slim model or a ply file

In: a model. Out: files, and the same back.
"""
