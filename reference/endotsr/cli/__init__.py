"""One module per command, each with `run(argv) -> exit code`. Heavy imports are inside functions.

In: the words after the command. Out: files, text on standard output, an exit code. A command only reads its options,
calls the other rooms and reports the result.
"""
