"""One module a command, each with `run(argv) -> exit code`. Heavy imports stay inside the functions.

Comes in: the words after the command. Goes out: files, a table on standard output, an exit code.
No mathematics here: a command reads its options, calls the rooms in order and says what happened.
"""
