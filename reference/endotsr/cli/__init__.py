"""One module a command, each with `run(argv) -> exit code`. Heavy imports stay inside the functions.

In: the words after the command. Out: files, a table on standard output, an exit code.
There is no mathematics here: a command reads its options, calls the packages in order and reports the result.
"""
