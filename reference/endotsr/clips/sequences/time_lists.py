"""Lists of times: one line per picture, with a stamp and perhaps the name of the picture.

In: a file of text. Out: stamps as they are written, and files.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.files import read_text
from endotsr.untrusted.names import relative_path

SHORTEST = 1_000_000  # nanoseconds between two pictures; below it, the stamps have another unit


class TimedFile(NamedTuple):
    """A line of a list."""

    stamp: int  # nanoseconds
    file: Path


def nanosecond_list(path: Path, folder: Path, notes: list[str]) -> list[TimedFile]:
    """The lines `nanoseconds,file` of EuRoC, in time order. A head line and lines that begin with # are comments.

    Raises:  InputError naming the line; for two lines of one stamp, and for stamps in another unit.
    """
    rows: dict[int, Path] = {}
    wider = False
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = [word.strip() for word in line.replace(",", " ").split()]
        where = f"{path}: line {number}"
        if not words or words[0].startswith("#") or (not rows and not words[0][0].isdigit()):
            continue
        if len(words) < 2 or not words[0].isdecimal() or len(words[0]) > 19:
            raise InputError(f"{where}: allowed: nanoseconds (an integer), a comma and the name of a picture")
        stamp = int(words[0])
        if stamp in rows:
            raise InputError(f"{where}: the stamp {stamp} occurs twice; allowed: one line per picture")
        rows[stamp] = folder / relative_path(words[1], where)
        wider = wider or len(words) > 2
    if not rows:
        raise InputError(f"{path}: names no picture; allowed: lines of nanoseconds and the name of a picture")
    stamps = sorted(rows)
    usual = float(np.median(np.diff(np.array(stamps, np.float64) - stamps[0]))) if len(stamps) > 1 else SHORTEST
    if usual < SHORTEST:
        raise InputError(
            f"{path}: {1e9 / usual:.3g} pictures a second by its stamps; allowed: stamps in nanoseconds, as EuRoC"
            " has them"
        )
    if wider:
        notes.append(f"{path.parent.name}/{path.name}: columns after the second are not used")
    return [TimedFile(stamp, rows[stamp]) for stamp in stamps]
