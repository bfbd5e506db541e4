"""The two errors of unusable input. The command line prints them as one line and exits with code 2."""

import unicodedata

# Categories of Unicode: control characters, formats (which can reverse the reading order), surrogates, line separators.
INVISIBLE = {"Cc", "Cf", "Cs", "Zl", "Zp"}


def visible(text: str) -> str:
    """Text in which no character can move the cursor or change the reading order of a terminal; others are escaped."""
    return "".join(c if unicodedata.category(c) not in INVISIBLE else f"\\u{ord(c):04x}" for c in text)


class InputError(ValueError):
    """Input that cannot be used. The message names the file, the frame or key, the reason and what is allowed.

    Names of files and words from them may stand in the message: it is kept `visible`, line by line.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__("\n".join(map(visible, str(message).split("\n"))))


class CalibrationError(InputError):
    """Equation (7) has no solution. The message holds a table of the gradient ratios of every view."""
