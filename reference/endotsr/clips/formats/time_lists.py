"""Lists of times: one line per picture, with a stamp and perhaps the name of the picture.

EuRoC's data.csv is read by its own rules. Other lists beside pictures, such as times.txt of KITTI and timestamps.csv,
state the times of the pictures if they fit these, and are named with the reason if they do not. In: a file of text.
Out: stamps, and notes.
"""

import re
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import visible_files
from endotsr.errors import InputError
from endotsr.untrusted.files import read_text
from endotsr.untrusted.names import counted, plain_line, relative_path

LISTS = ("*time*.txt", "*time*.csv", "*stamps.txt", "*stamps.csv")  # in lower case
# The beginning of the name of a unit in a head line, seconds per step, and the unit in words.
UNITS = (("s", 1.0, "seconds"), ("m", 1e-3, "milliseconds"), ("u", 1e-6, "microseconds"), ("n", 1e-9, "nanoseconds"))
UNIT = re.compile(r"(?:[\[(_ ]|^)(nano|micro|milli|ns|us|µs|ms|secs?|seconds|s)(?:seconds|secs?)?[\])]?$")
DATE = re.compile(r"(\d{4}[-/]\d\d[-/]\d\d[T ]\d\d:\d\d:\d\d)(\.\d{1,12})?Z?")
EPOCH = (1e9, 4e9)  # seconds from 1970: 2001 to 2096
FASTEST = 500.0  # pictures a second of a camera whose times count from its start
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
            raise InputError(f"{where}: use nanoseconds (an integer), a comma and the name of a picture")
        stamp = int(words[0])
        if stamp in rows:
            raise InputError(f"{where}: the stamp {stamp} occurs twice; use one line per picture")
        rows[stamp] = folder / relative_path(words[1], where)
        wider = wider or len(words) > 2
    if not rows:
        raise InputError(f"{path}: names no picture; use lines of nanoseconds and the name of a picture")
    stamps = sorted(rows)
    usual = float(np.median(np.diff(np.array(stamps, np.float64) - stamps[0]))) if len(stamps) > 1 else SHORTEST
    if usual < SHORTEST:
        raise InputError(
            f"{path}: {1e9 / usual:.3g} pictures a second by its stamps; use stamps in nanoseconds, as EuRoC has them"
        )
    if wider:
        notes.append(f"{path.parent.name}/{path.name}: columns after the second are not used")
    return [TimedFile(stamp, rows[stamp]) for stamp in stamps]


class PictureTimes(NamedTuple):
    """Times of the pictures of a folder, as a list beside them states them."""

    seconds: NDArray[np.float64] | None = None  # (n,) on the clock of the list, ascending; None: no list fits
    notes: tuple[str, ...] = ()
    files: tuple[str, ...] = ()  # names of the lists, in lower case


class _Unfit(Exception):
    """Why a list does not state the times of the pictures."""


def picture_times(folders: list[Path], pictures: list[Path], rate: float | None) -> PictureTimes:
    """The times in the first list beside the pictures that fits them; every other list is named with the reason.

    folders   where lists may be
    rate      a stated frame rate, which overrides lists

    Raises:  InputError for a list that cannot be read.
    """
    seconds, notes, names = None, [], []
    for folder in dict.fromkeys(folders):
        for file in visible_files(folder):
            if not any(fnmatchcase(file.name.lower(), pattern) for pattern in LISTS) or not file.is_file():
                continue
            names.append(file.name.lower())
            try:
                if rate is not None:
                    raise _Unfit("--source-rate overrides it")
                if seconds is not None:
                    raise _Unfit("another list states them")
                seconds, unit, more = _seconds_of(file, pictures)
            except _Unfit as why:
                notes.append(f"{file.name}: not used as times of the pictures: {why}")
                continue
            usual = float(np.median(np.diff(seconds)))
            notes.append(
                f"{file.name}: times of the pictures in {unit}, {seconds[-1] - seconds[0]:g} s in all, usually"
                f" {1 / usual:.4g} a second{more}; --source-rate overrides them"
            )
    return PictureTimes(seconds, tuple(notes), tuple(names))


def _seconds_of(path: Path, pictures: list[Path]) -> tuple[NDArray[np.float64], str, str]:
    """Seconds of every picture, their unit in the file, and a remark."""
    head, rows = _columns(path)
    of_time, of_name = _time_column(head, rows, {name for file in pictures for name in (file.name, file.stem)})
    remark = ""
    if of_name is not None:
        by_name = {PurePosixPath(row[of_name].replace("\\", "/")).name: row[of_time] for row in rows}
        found = [by_name.get(file.name, by_name.get(file.stem, "")) for file in pictures]
        if "" in found:
            raise _Unfit(f"it has no line for {pictures[found.index('')].name}")
        remark = f", {len(rows) - len(found)} lines name no picture" if len(rows) > len(found) else ""
    else:
        found = [row[of_time] for row in rows]
        if len(found) != len(pictures):
            raise _Unfit(f"{counted(len(found), 'line')} for {counted(len(pictures), 'picture')}")
    stamps = np.array([float(word) for word in found])
    if len(stamps) < 2 or not (np.diff(stamps) > 0).all():
        raise _Unfit("its times do not ascend")
    if (np.diff(stamps) == 1).all() and (stamps == np.rint(stamps)).all():
        raise _Unfit("it counts frames")
    tick, unit = unit_of_stamps(stamps, head[of_time] if head else "")
    return stamps * tick, unit, remark


def unit_of_stamps(stamps: NDArray[np.float64], head: str = "") -> tuple[float, str]:
    """Seconds per step of stamps, and the unit in words.

    stamps   (n,) ascending
    head     the name of their column, which may state a unit, such as `timestamp [ns]`

    Without a stated unit, stamps that count from 1970 have the unit in which they lie between 2001 and 2096. Others
    have the one in which the usual rate is from 0.5 to 500 pictures a second; as units differ by 1000, that is one.
    """
    stated = UNIT.search(head.lower())
    if stated:
        return next((step, name) for begins, step, name in UNITS if stated[1].replace("µ", "u").startswith(begins))
    usual = float(np.median(np.diff(stamps)))
    for _, step, name in UNITS:
        if EPOCH[0] <= stamps[0] * step <= EPOCH[1] and 1e-3 <= usual * step <= 1e3:
            return step, name
    fits = [(step, name) for _, step, name in UNITS if 1 / FASTEST < usual * step <= 1000 / FASTEST]
    if not fits:
        raise _Unfit(f"{1 / usual:.3g} pictures a second, if its times are seconds")
    return fits[0]


def _columns(path: Path) -> tuple[list[str], list[list[str]]]:
    """The names of the columns, if a head line has them, and the words of every line; a date is one word, seconds."""
    head: list[str] = []
    rows: list[list[str]] = []
    for line in read_text(path).splitlines():
        text = DATE.sub(_epoch, line.strip().strip("#").strip())
        words = [word for word in (re.split(r"[,;\t]", text) if re.search(r"[,;\t]", text) else text.split())]
        words = [word.strip().strip('"') for word in words]
        if not text or line.strip().startswith("#") or (not rows and not any(map(_is_number, words))):
            head = words if text else head
            continue
        rows.append(words)
    if not rows:
        raise _Unfit("it holds no number")
    if len({len(row) for row in rows}) > 1:
        raise _Unfit("its lines differ in their number of columns")
    return (head if len(head) == len(rows[0]) else []), rows


def _time_column(head: list[str], rows: list[list[str]], names: set[str]) -> tuple[int, int | None]:
    """The column of the times, and that of the names of pictures."""
    columns = range(len(rows[0]))
    numeric = [k for k in columns if all(_is_number(row[k]) for row in rows)]
    named = [k for k in columns if k not in numeric
             and any(PurePosixPath(row[k].replace("\\", "/")).name in names for row in rows)]  # fmt: skip
    by_head = [k for k in numeric if head and re.search("time|stamp|sec", head[k].lower())]
    counting = [k for k in numeric if [float(row[k]) for row in rows] in (
        [float(first + i) for i in range(len(rows))] for first in (0, 1))]  # fmt: skip
    times = by_head if len(by_head) == 1 else [k for k in numeric if len(numeric) == 1 or k not in counting]
    if len(times) != 1:
        raise _Unfit(f"it has {len(rows[0])} columns, and none is known as the time; a head line may name it")
    return times[0], named[0] if named else None


def _epoch(found: re.Match[str]) -> str:
    """Seconds from 1970 of a date, which counts as UTC."""
    try:
        whole = datetime.fromisoformat(found[1].replace("/", "-")).replace(tzinfo=UTC)
    except ValueError:
        raise _Unfit(f"{plain_line(found[0])} is no date") from None
    return f"{int(whole.timestamp())}{found[2] or ''}"


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
