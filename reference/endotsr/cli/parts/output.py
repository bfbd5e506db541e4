"""Output options of every command: `-q` prints only errors, `--log-file FILE` also writes the output to a file.

In: the words of a command line. Out: the words without these options, and redirected standard streams. Errors are
always printed. A log file contains all standard output and standard error, also with `-q`.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from endotsr.errors import InputError
from endotsr.training.runs.files import os_error_line, refuse_no_text
from endotsr.untrusted.names import plain_line

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
        raise InputError(f"--log-file {file}: the command names this file elsewhere too; use another name")
    return OutputOptions(quiet, file), rest


@contextlib.contextmanager
def redirected(output: OutputOptions) -> Iterator[None]:
    """Redirect standard output and standard error for the block; an existing log file is overwritten.

    Raises: InputError if the log file cannot be written, or would replace another kind of file.
    """
    with contextlib.ExitStack() as stack:
        log = _Log(output.log_file) if output.log_file else None
        if log is not None:
            stack.callback(log.close)
        if output.quiet or log is not None:
            stack.enter_context(contextlib.redirect_stdout(_Tee(None if output.quiet else sys.stdout, log)))
        if log is not None:
            stack.enter_context(contextlib.redirect_stderr(_Tee(sys.stderr, log)))
        yield


class _Log:
    """The log file. If a line cannot be written, as on a full disk, the log ends and the command goes on."""

    def __init__(self, file: Path) -> None:
        """Open the file. Raises InputError as `redirected`."""
        self._file = file
        try:
            refuse_no_text(file)
            self._stream: IO[str] | None = file.open("w", encoding="utf-8", newline="\n", buffering=1)
        except OSError as error:
            raise InputError(f"{file}: cannot be written: {error.strerror}") from None
        self._shown = sys.stderr  # before it is redirected

    def write(self, text: str) -> None:
        """Write the text, or end the log with one warning."""
        self._try(lambda stream: stream.write(text))

    def flush(self) -> None:
        """As `TextIO.flush`."""
        self._try(lambda stream: stream.flush())

    def close(self) -> None:
        """As `TextIO.close`."""
        self._try(lambda stream: stream.close())
        self._stream = None

    def _try(self, act: Callable[[IO[str]], object]) -> None:
        stream = self._stream
        if stream is None:
            return
        try:
            act(stream)
        except OSError as error:
            self._stream = None
            with contextlib.suppress(OSError):
                stream.close()  # fails once more on the rest of the text
            line = plain_line(os_error_line(error, self._file))
            print(f"endotsr: warning: {line}; the log ends here, the command goes on", file=self._shown, flush=True)


class _Tee:
    """A text stream that writes to a shown stream, a log, both or neither."""

    def __init__(self, shown: Any, log: _Log | None) -> None:
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
