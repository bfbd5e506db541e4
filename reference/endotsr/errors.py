"""The two errors a person can cause. The command line prints them as one line and leaves with exit code 2."""


class InputError(ValueError):
    """Input that cannot be used: names the file, the frame or key, the reason and what is allowed."""


class CalibrationError(InputError):
    """Equation (7) has no answer: carries a per-view table of the gradient ratios that were found."""
