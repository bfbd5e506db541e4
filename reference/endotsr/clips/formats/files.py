"""The picture files of a sequence folder: listing in time order, pairing across folders, hashing."""

import hashlib
import os
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from endotsr.clips.formats.conversions import conversion
from endotsr.errors import InputError
from endotsr.untrusted.files import open_regular
from endotsr.untrusted.names import counted, file_name, plain_line
from endotsr.untrusted.png import LARGEST_FILE

TRUTH = "truth"  # folder of a simulated sequence
ALLOWED_NAMES = "use names in one pattern that differ in the frame number, and no other PNG files"


def visible_files(folder: Path, pattern: str = "*") -> list[Path]:
    """The entries of a folder by name, without hidden ones, such as the `._NAME` that macOS writes beside a file."""
    return sorted(file for file in folder.glob(pattern) if not file.name.startswith("."))


def list_pictures(folder: Path, endings: tuple[str, ...] = (".png",)) -> list[Path]:
    """Picture files of a folder in time order: by the numbers in their names, or by name if there are no numbers.

    endings  extensions in lower case; other files are ignored

    Raises:  InputError if the folder is missing or has no such file, if a name is not UTF-8 or contains more or fewer
             numbers than the others, or if two files have the same number.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: folder not found")
    files = [file for file in visible_files(folder) if file.suffix.lower() in endings]
    if not files:
        kinds = "PNG file" if endings == (".png",) else f"PNG file, and none that ends in {', '.join(endings[1:])}"
        raise InputError(f"{folder}: holds no {kinds}{_what_else(folder)}")
    _check_names_are_text(files)
    return [files[i] for i in time_order(files)]


def _what_else(folder: Path) -> str:
    """What a folder without pictures holds, as the end of a message; nothing for an empty one."""
    entries = sorted(folder.iterdir())
    seen = [file for file in entries if not file.name.startswith(".")]
    inner = [plain_line(entry.name) for entry in seen if entry.is_dir()]
    if inner:
        return f"; it holds {'the folder' if len(inner) == 1 else 'the folders'} {shortened(inner)}: give one of them"
    endings = Counter(file.suffix.lower() for file in seen)
    if endings:
        ending, count = endings.most_common(1)[0]
        kind = f"of the ending {plain_line(ending)}" if ending else "without an ending"
        return f"; it holds {counted(count, 'file')} {kind}{conversion(folder, ending)}"
    hidden = f"; it holds {counted(len(entries), 'file')} whose name begins with a dot, as hidden files do: rename them"
    return hidden if entries else "; it is empty"


def time_order(files: list[Path]) -> list[int]:
    """Indices of the files, which share a folder, in time order. Rules and errors as in `list_pictures`."""
    _check_names_alike(files)
    _check_decimals(files)
    numbers = frame_numbers(files)
    if numbers is None:
        return sorted(range(len(files)), key=lambda i: files[i])
    if len(set(numbers)) < len(numbers):
        repeated = _first_repeated(files, numbers)
        raise InputError(
            f"{files[0].parent}: two files carry the same frame number, for example {repeated}; move one of each pair"
            " elsewhere, or give every frame a number of its own"
        )
    return sorted(range(len(files)), key=lambda i: numbers[i])


def frame_numbers(files: list[Path]) -> list[tuple[int, ...]] | None:
    """The frame number of every file: all groups of digits that differ between the names (several in a time stamp).

    None without such a number. For a single file, the last group of digits.
    """
    columns = _digit_columns(files)
    varying = [column for column in columns if len(set(column)) > 1]
    if len(files) == 1:
        varying = columns[-1:]
    return list(zip(*varying)) if varying else None


def check_pairing(reference: list[Path], other: list[Path]) -> None:
    """Refuse two folders whose files do not match by frame number, or by name if neither has numbers.

    Raises:  InputError naming the first frame without a partner, or a file whose name cannot be paired.
    """
    here, there = frame_numbers(reference), frame_numbers(other)
    if here is None and there is None:
        _check_same_keys(_name_keys(reference), _name_keys(other), reference, other)
    elif here is None or there is None:
        bare, numbered = (reference, other) if here is None else (other, reference)
        raise InputError(
            f"{bare[0]}: no frame number distinguishes the names of {bare[0].parent.name}, while"
            f" {numbered[0].parent.name} has them ({numbered[0].name}); {_counts(reference, other)}; {ALLOWED_NAMES}"
        )
    elif len(here[0]) != len(there[0]):
        wide, narrow = (reference, other) if len(here[0]) > len(there[0]) else (other, reference)
        raise InputError(
            f"{_departing(wide)}: the names of {wide[0].parent.name} differ in more than one number, those of"
            f" {narrow[0].parent.name} ({narrow[0].name}) in fewer; {_counts(reference, other)}; {ALLOWED_NAMES}"
        )
    else:
        _check_same_keys(here, there, reference, other)


def _check_same_keys(here: list, there: list, reference: list[Path], other: list[Path]) -> None:
    """Refuse the first file whose key, a frame number or a name, is missing in the other folder."""
    for keys, files, missing_keys, missing_files in ((here, reference, there, other), (there, other, here, reference)):
        known = set(missing_keys)
        lonely = next((i for i, key in enumerate(keys) if key not in known), None)
        if lonely is not None:
            raise InputError(
                f"{missing_files[0].parent}: has no file for frame {_text(keys[lonely])}"
                f" ({files[0].parent.name}/{files[lonely].name}); {_counts(reference, other)}; use one per frame"
            )
    if here != there:  # two spellings of one name, such as a.png and a.PNG
        raise InputError(f"{other[0].parent}: the files do not match one to one; {_counts(reference, other)}")


def _check_names_are_text(files: list[Path]) -> None:
    """Refuse a path that is not UTF-8, and an unsafe file name: runs name their pictures after the frames."""
    for file in files:
        try:
            str(file).encode("utf-8")
        except UnicodeEncodeError:
            shown = os.fsencode(file).decode("utf-8", "backslashreplace")
            raise InputError(f"{shown}: the name is not UTF-8; use file and folder names in UTF-8") from None
        file_name(file.stem, str(file.parent))


def _check_names_alike(files: list[Path]) -> None:
    """Refuse a file whose name has more or fewer numbers than most names, which prevents ordering by number."""
    counts = [len(re.findall(r"\d+", file.stem)) for file in files]
    usual, frequency = Counter(counts).most_common(1)[0]
    if frequency == len(files):
        return
    odd = next(i for i, count in enumerate(counts) if count != usual)
    raise InputError(
        f"{files[odd]}: numbers in this name: {counts[odd]}; in the names of {frequency} of the {len(files)} files"
        f" here, {files[counts.index(usual)].name} for one: {usual}; {ALLOWED_NAMES}"
    )


def _check_decimals(files: list[Path]) -> None:
    """Refuse decimals of different lengths: ordered by integer groups, 1.5 precedes 1.25.

    A point counts as a decimal point if the number before it also varies, or if the name has no other part.
    """
    for column in zip(*(re.findall(r"(\d+)\.(\d+)", file.stem) for file in files)):
        other = next((i for i, (_, part) in enumerate(column) if len(part) != len(column[0][1])), 0)
        alone = all(re.fullmatch(r"\d+\.\d+", file.stem) for file in files)
        if other and (alone or len({whole for whole, _ in column}) > 1):
            raise InputError(
                f"{files[other]}: another number of decimals than in {files[0].name}: the"
                " order is ambiguous; use decimals of one length, such as 1.50 and 1.25"
            )


def _digit_columns(files: list[Path]) -> list[list[int]]:
    """The groups of digits of all names: one list per group, one number per file."""
    groups = [re.findall(r"\d+", file.stem) for file in files]
    return [[int(digits) for digits in column] for column in zip(*groups)]


def _departing(files: list[Path]) -> Path:
    """The first file that lacks a number shared by most names, such as a version; else the first file."""
    for column in _digit_columns(files):
        value, frequency = Counter(column).most_common(1)[0]
        if len(files) / 2 < frequency < len(files):
            return next(file for file, number in zip(files, column) if number != value)
    return files[0]


def _name_keys(files: list[Path]) -> list[tuple[str]]:
    """Keys of names without numbers: the part before the first dot if it is unique, else the stem."""
    short = [file.name.split(".")[0] for file in files]
    return [(key,) for key in (short if len(set(short)) == len(short) else [file.stem for file in files])]


def shortened(names: list[str]) -> str:
    """At most five of the names and the count of the others, for a message."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def hash_files(root: Path, files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 (hex) of every file by its path relative to `root`, with forward slashes, in the given order."""
    found = {}
    for file in files:
        try:
            with open_regular(file, LARGEST_FILE) as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read: {error.strerror}") from None
        found[file.relative_to(root).as_posix()] = digest
    return found


def _counts(a: list[Path], b: list[Path]) -> str:
    return f"{a[0].parent.name} holds {counted(len(a), 'file')}, {b[0].parent.name} {len(b)}"


def _text(number: tuple) -> str:
    return "-".join(map(str, number))


def _first_repeated(files: list[Path], numbers: list[tuple[int, ...]]) -> str:
    seen: dict[tuple[int, ...], Path] = {}
    for file, number in zip(files, numbers):
        if number in seen:
            return f"{seen[number].name} and {file.name}"
        seen[number] = file
    return ""


def has_truth(folder: Path) -> bool:
    """Whether a sequence folder contains the truth of a simulated scene."""
    return (Path(folder) / TRUTH / "truth.json").is_file()
