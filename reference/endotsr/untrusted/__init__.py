"""What comes from a file is untrusted: it passes one of these modules before anything else reads it.

names    names and lines of text that become a path, or that a terminal shows
files    opening and reading: regular files alone, up to a stated size
json     JSON objects without NaN; lists of numbers within their range
arrays   .npy and .npz without pickle, no larger than the file that holds them
writing  files and folders that appear whole, under names that nobody can put a link at
png      PNG files whose pixels are all there, without chunks that the pixels do not need

Every refusal is an `InputError` of one line that names the file, the reason and what is allowed. These modules know
nothing of sequences, runs or models: their callers say what a number may be.
"""
