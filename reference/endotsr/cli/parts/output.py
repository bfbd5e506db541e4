"""Output options of every command: `-q` prints only errors, `--log-file FILE` also writes the output to a file.

In: the words of a command line. Out: the words without these options, and redirected standard streams. Errors are
always printed. A log file contains all standard output and standard error, also with `-q`.
"""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from endotsr.errors import InputError
from endotsr.training.runs.files import refuse_no_text

QUIET, LOG_FILE = ("-q", "--quiet"), "--log-file"


class OutputOptions(NamedTuple):
    """The output options."""

    quiet: bool = False
    log_file: Path | None = None


def split_output(words: list[str]) -> tuple[OutputOptions, list[str]]:
    """The output options, and the other words in order.

    Raises: InputError for `--log-file` without a value, or with a file that another word names.
    """
    rest, quiet, file = [], False, None
    found = iter(words)
    for word in found:
        name, equals, value = word.partition("=")
        if word in QUIET:
            quiet = True
        elif name == LOG_FILE:
            value = value if equals else next(found, "")
            if not value:
                raise InputError("--log-file: missing value FILE")
            file = Path(value)
        else:
            rest.append(word)
    if file is not None and file in {Path(word.partition("=")[2] or word) for word in rest}:
        raise InputError(f"--log-file {file}: the command names this file elsewhere too; allowed: another name")
    return OutputOptions(quiet, file), rest


@contextlib.contextmanager
def redirected(output: OutputOptions) -> Iterator[None]:
    """Redirect standard output and standard error for the block; an existing log file is overwritten.

    Raises: InputError if the log file cannot be written, or would replace another kind of file.
    """
    with contextlib.ExitStack() as stack:
        log = stack.enter_context(_opened(output.log_file)) if output.log_file else None
        if output.quiet or log is not None:
            stack.enter_context(contextlib.redirect_stdout(_Tee(None if output.quiet else sys.stdout, log)))
        if log is not None:
            stack.enter_context(contextlib.redirect_stderr(_Tee(sys.stderr, log)))
        yield


def _opened(file: Path) -> IO[str]:
    try:
        refuse_no_text(file)
        return file.open("w", encoding="utf-8", newline="\n", buffering=1)
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror}") from None


class _Tee:
    """A text stream that writes to a shown stream, a log, both or neither."""

    def __init__(self, shown: Any, log: IO[str] | None) -> None:
        self._shown, self._log = shown, log
        self.encoding = "utf-8"

    def write(self, text: str) -> int:
        """As `TextIO.write`."""
        if self._shown is not None:
            self._shown.write(text)
        if self._log is not None:
            self._log.write(text)
        return len(text)

    def flush(self) -> None:
        """As `TextIO.flush`."""
        for stream in (self._shown, self._log):
            if stream is not None:
                stream.flush()

    def isatty(self) -> bool:
        """Whether to draw a progress bar: the shown stream is a terminal, and there is no log."""
        return self._log is None and self._shown is not None and self._shown.isatty()

    def fileno(self) -> int:
        """The descriptor of the shown stream. Raises: OSError without one."""
        if self._shown is None:
            raise OSError("a quiet stream has no file")
        return self._shown.fileno()
