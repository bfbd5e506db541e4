"""The picture files of a sequence folder: listing them in time order, pairing them across folders, hashing them."""

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from endotsr.errors import InputError


def list_pictures(folder: Path) -> list[Path]:
    """PNG files of a folder in time order: by the numbers in their names where every name has them, else by name.

    Raises:  InputError if the folder is missing or holds no PNG, or if two files carry the same number.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: folder not found")
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() == ".png" and not f.name.startswith("."))
    if not files:
        raise InputError(f"{folder}: holds no PNG file")
    numbers = frame_numbers(files)
    if numbers is None:
        return files
    if len(set(numbers)) < len(numbers):
        raise InputError(
            f"{folder}: two files carry the same frame number, for example {_first_repeated(files, numbers)}"
        )
    return [file for _, file in sorted(zip(numbers, files), key=lambda pair: pair[0])]


def frame_numbers(files: list[Path]) -> list[tuple[int, ...]] | None:
    """The number in every file name: all groups of digits that differ between the files (several in a time stamp).

    None if the names carry no such number. A single file has its last group of digits.
    """
    groups = [re.findall(r"\d+", file.stem) for file in files]
    if not groups[0] or len({len(g) for g in groups}) != 1:
        return None
    columns = [[int(digits) for digits in column] for column in zip(*groups)]
    varying = [column for column in columns if len(set(column)) > 1]
    if len(files) == 1:
        varying = columns[-1:]
    return list(zip(*varying)) if varying else None


def check_pairing(reference: list[Path], other: list[Path]) -> None:
    """Refuse two folders whose files do not belong together, by count and by frame number.

    Raises:  InputError naming the first frame that has no partner.
    """
    here, there = frame_numbers(reference), frame_numbers(other)
    a, b = reference[0].parent, other[0].parent
    if here and there and len(here[0]) == len(there[0]) and here != there:
        lonely = sorted(set(here) - set(there))
        if lonely:
            name = reference[here.index(lonely[0])].name
            raise InputError(
                f"{b}: has no file for frame {_text(lonely[0])} ({a.name}/{name}); {_counts(reference, other)}"
            )
        surplus = sorted(set(there) - set(here))
        name = other[there.index(surplus[0])].name
        raise InputError(
            f"{a}: has no file for frame {_text(surplus[0])} ({b.name}/{name}); {_counts(reference, other)}"
        )
    if len(reference) != len(other):
        raise InputError(f"{b}: the number of files does not match; {_counts(reference, other)}")


def hash_files(root: Path, files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 in hex of every file, by its path relative to `root` (with forward slashes), in the given order."""
    found = {}
    for file in files:
        try:
            with file.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read: {error.strerror}") from None
        found[file.relative_to(root).as_posix()] = digest
    return found


def _counts(a: list[Path], b: list[Path]) -> str:
    return f"{a[0].parent.name} holds {len(a)} files, {b[0].parent.name} {len(b)}"


def _text(number: tuple[int, ...]) -> str:
    return "-".join(map(str, number))


def _first_repeated(files: list[Path], numbers: list[tuple[int, ...]]) -> str:
    seen: dict[tuple[int, ...], Path] = {}
    for file, number in zip(files, numbers):
        if number in seen:
            return f"{seen[number].name} and {file.name}"
        seen[number] = file
    return ""
