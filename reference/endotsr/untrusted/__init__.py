"""File content is untrusted. It passes through one of these modules before any other code reads it.

names    names that become paths, and text that a terminal displays
files    opening and reading: regular files only, up to a given size
json     JSON objects without NaN; numbers and lists checked for type and range
arrays   .npy and .npz without pickle, using no more memory than the file
writing  atomic writing of files and folders, under unpredictable temporary names
marks    the marks by which endotsr recognises a file that it wrote
png      complete PNG files, reduced to the chunks that define the pixels

Every refusal is an `InputError` of one line that names the file, the reason and the allowed values. These modules do
not depend on sequences, runs or models. Callers state the allowed range of a number.
"""
