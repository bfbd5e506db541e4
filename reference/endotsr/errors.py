"""The two errors of unusable input. The command line prints them as one line and exits with code 2."""


class InputError(ValueError):
    """Input that cannot be used. The message names the file, the frame or key, the reason and what is allowed."""


class CalibrationError(InputError):
    """Equation (7) has no solution. The message holds a table of the gradient ratios of every view."""
