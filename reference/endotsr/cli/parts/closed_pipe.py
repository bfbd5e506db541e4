"""An output whose reader has left, as in `endotsr ... | head -1`: a quiet end with exit code 141, as of other programs.

For programs that print; `cli/main.py` and the programs of the repository end in this way.
"""

import errno
import os
import sys
from collections.abc import Callable

CLOSED_PIPE = 141  # 128 + SIGPIPE


def until_closed(program: Callable[[], int | None]) -> int:
    """Run a program that returns its exit code, or None for 0; CLOSED_PIPE if the reader of its output has left."""
    try:
        code = program()
        if sys.stdout is not None:
            sys.stdout.flush()  # raises here, and not in the finalisation of the process
        return code or 0
    except OSError as error:
        if not is_closed_pipe(error):
            raise
        discard_unwritten()
        return CLOSED_PIPE


def is_closed_pipe(error: OSError) -> bool:
    """Whether an output pipe was closed. On Windows such a write is an invalid argument without a file name."""
    invalid = os.name == "nt" and error.errno == errno.EINVAL and error.filename is None
    return isinstance(error, BrokenPipeError) or invalid


def discard_unwritten() -> None:
    """Drop the text that a closed pipe or a full disk does not take, so that the exit does not try it once more."""
    for stream in filter(None, (sys.__stdout__, sys.__stderr__)):  # None without a console
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        except ValueError:  # the program that called `main` has closed or detached the stream
            pass
