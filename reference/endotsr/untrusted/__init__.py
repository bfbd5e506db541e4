"""File content is untrusted. It passes through one of these modules before any other code reads it.

names    names that become paths, and text that a terminal displays
files    opening and reading: regular files only, up to a given size
json     JSON objects without NaN; numbers and lists checked for type and range
toml     TOML of settings, read and written
yaml     YAML, also as OpenCV and ROS write it
storage  OpenCV's storage in XML
sections sections of settings, checked against their types and ranges
arrays   .npy and .npz without pickle, using no more memory than the caller allows
matlab   MAT-files; `matlab_elements` checks them before SciPy parses them
ply      the vertices of PLY files
writing  atomic writing of files and folders, under unpredictable temporary names
marks    the marks by which endotsr recognises a file that it wrote
png      complete PNG files, reduced to the chunks that define the pixels

A refusal is an `InputError` of one line that names the file and the reason, and what is allowed where that helps;
`array_from` and `NpzFile.read` raise `RefusedArray`, to which the caller adds the file. These modules do not depend on
sequences, runs or models. Callers state the allowed range of a number.
"""
