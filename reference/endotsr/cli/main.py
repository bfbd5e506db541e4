"""The command `endotsr`: imports and runs one subcommand, and reports user errors in one line.

No heavy imports here: `endotsr --help` starts quickly. Exit codes: 0 success, 1 a check or comparison failed, 2 invalid
input or usage, 130 interrupted (Ctrl-C or SIGTERM), 141 output pipe closed (128 + SIGPIPE, like other programs).
"""

import importlib
import io
import os
import sys

from endotsr import __version__
from endotsr.cli.parts.closed_pipe import CLOSED_PIPE, discard_unwritten, is_closed_pipe
from endotsr.cli.parts.commands import COMMANDS, FORMER
from endotsr.cli.parts.output import redirected, split_output
from endotsr.errors import CalibrationError, InputError
from endotsr.training.runs.stopping import INTERRUPTED, signals_stop
from endotsr.untrusted.names import choice, plain_line

# Read when NumPy is loaded. Several threads call BLAS at the same time, whose calls would wait for one another actively
# if each had threads of its own; `--threads 1` would not hold either.
BLAS = ("OPENBLAS_NUM_THREADS", "1")
OTHER_PROGRAMS = "close other programs"
LESS_MEMORY = {  # advice by command; the other commands get OTHER_PROGRAMS
    "train": "a smaller --scale, fewer --frames or a smaller --density.maximum needs less; with --resume, "
    + OTHER_PROGRAMS,
    "demo": "a smaller --scale needs less",
    "bench": "a smaller size needs less (`endotsr bench --help`)",
}


def main(argv: list[str] | None = None) -> int:
    """Run one command; `argv` without the program name, None = that of the process. Returns the exit code."""
    if argv is not None:
        return _run(argv)
    os.environ.setdefault(*BLAS)
    code = _run(sys.argv[1:])
    if code == INTERRUPTED:
        _leave(code)
    return code


def _leave(code: int) -> None:
    """End the process without its finalisation, which ends threads in the middle of C++.

    An interruption leaves threads in OpenCV, for example in a flow. Python ends them when they return to it, and the
    C++ runtime then aborts the process, with exit code 134 and a line of its own.
    """
    discard_unwritten()
    os._exit(code)


def _run(argv: list[str]) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # the terminal's encoding may lack letters of a file name
    try:
        output, words = split_output(argv)
        with redirected(output):
            code = _main(words)
            if sys.stdout is not None:
                sys.stdout.flush()  # raises for a closed pipe, which at the exit of the program would be a traceback
            return code
    except InputError as error:
        return _fail(str(error))
    except OSError as error:  # of the line above, or of what a handler of `_main` prints
        return _system_error(error)


def _main(words: list[str]) -> int:
    try:
        if _answered(words):
            return 0
        with signals_stop():
            return _command(words[0])(words[1:])
    except CalibrationError as error:
        line, _, table = str(error).partition("\n")
        print(table)
        return _fail(line)
    except InputError as error:
        return _fail(str(error))
    except SystemExit as leaving:  # `--help` of a command
        return leaving.code if isinstance(leaving.code, int) else 0
    except KeyboardInterrupt as interrupt:
        _complain(f"\nendotsr: interrupted{': ' if interrupt.args else ''}{' '.join(interrupt.args)}")
        return INTERRUPTED
    except OSError as error:
        return _system_error(error)
    except FloatingPointError as error:
        _fail(f"training diverged: non-finite values: {error}; a smaller learning rate may help")
        return 1
    except MemoryError:
        return _fail(f"not enough memory; {LESS_MEMORY.get(words[0], OTHER_PROGRAMS)}")


def _answered(words: list[str]) -> bool:
    """Print the answer to an option of `endotsr` itself; False if the words are a command. Raises InputError."""
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
    elif words[0] == "--version":
        print(f"endotsr {__version__}")
    elif words[0].partition("=")[0] == "--completion":
        print(_completion(words), end="")
    elif words[0] == "--cache":
        from endotsr.cli.parts.kept import kept

        print(*kept(words[1:]), sep="\n")
    else:
        return False
    return True


def _system_error(error: OSError) -> int:
    """The exit code after an error of the system. A closed pipe, as of `endotsr ... | head`, has no message."""
    closed = is_closed_pipe(error)
    if not closed:
        from endotsr.training.runs.files import os_error_line

        _fail(os_error_line(error))
    discard_unwritten()
    return CLOSED_PIPE if closed else 2


def _command(name: str):
    if name in FORMER:
        raise InputError(f"the command {name!r} has moved: `{FORMER[name]}`")
    if name not in COMMANDS:
        import difflib

        meant = "".join(f"did you mean {word}? " for word in difflib.get_close_matches(name, COMMANDS, n=1))
        raise InputError(f"unknown command {name!r}; {meant}use {choice(COMMANDS)}")
    return importlib.import_module(f"endotsr.cli.{name}").run


def _completion(words: list[str]) -> str:
    """The completion script for a shell."""
    from endotsr.cli.parts.completion import SCRIPTS

    shell = "".join([words[0].partition("=")[2], *words[1:]])
    if shell not in SCRIPTS:
        raise InputError(f"--completion {shell!r} is not allowed; use {choice(SCRIPTS)}")
    return SCRIPTS[shell]()


def _fail(message: str) -> int:
    _complain(f"endotsr: error: {plain_line(message)}")
    return 2


def _complain(line: str) -> None:
    """Print a line on standard error, whose reader may have left: the exit code tells the rest."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        discard_unwritten()


def _overview() -> str:
    width = max(map(len, COMMANDS))
    return "\n".join(
        [
            "usage: endotsr COMMAND [OPTIONS]",
            "",
            "Reconstruct moving tissue from endoscopic video on the CPU: the reference implementation of Endo-TSR.",
            "",
            "commands:",
            *(f"  {name:<{width}}  {summary}" for name, summary in COMMANDS.items()),
            "",
            "options:",
            "  -h, --help   print this overview; `endotsr COMMAND --help` lists the options of a command",
            "  --version    print the version",
            "  --completion {bash,zsh,fish}   print a completion script for a shell",
            "  --cache [clear]   show location and size of the compiled kernels and kept flows; `clear` removes them",
            "  -q, --quiet; --log-file FILE   print only errors; also write the output to a file (any command)",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
