"""The two errors of invalid input. The command line prints them as one line and exits with code 2."""

import unicodedata

# Categories of Unicode: control characters, formats (which can reverse the reading order), surrogates, line separators.
INVISIBLE = {"Cc", "Cf", "Cs", "Zl", "Zp"}


def visible(text: str) -> str:
    """The text with all characters escaped that move the cursor or change the reading order of a terminal."""
    return "".join(c if unicodedata.category(c) not in INVISIBLE else f"\\u{ord(c):04x}" for c in text)


class InputError(ValueError):
    """Invalid input. The message names the file, the frame or key, the reason and the allowed values.

    The message may quote file names and file contents; each of its lines is made `visible`.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__("\n".join(map(visible, str(message).split("\n"))))


class CalibrationError(InputError):
    """Equation (7) has no solution. The message includes a table of the gradient ratios of all views."""
