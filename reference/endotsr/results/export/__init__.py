"""Export of a trained scene to files for other programs and to a compact format, and import.

ply      3-D Gaussian splatting files and point clouds, at one time    model      the slim model, a compact format
gltf     animated points                                               mesh       the visible surface at one time
npz      trained splats as arrays                                      placement  axes of the exported files
scene    a scene from a run folder, a slim model or a ply file         times      the user's choice of times
files    `endotsr export`: the format by the name of the file
"""
