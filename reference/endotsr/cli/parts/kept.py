"""`endotsr --cache`: show or remove the package's files outside run folders.

These are the compiled kernels: one folder per state of their sources and version of Numba. Older folders are never
read again. A folder in NUMBA_CACHE_DIR is shown but never removed.
"""

import os
import shutil
from pathlib import Path

from platformdirs import user_cache_dir

from endotsr.errors import InputError
from endotsr.untrusted.names import plain_line

CLEAR = "clear"


def kept(words: list[str]) -> list[str]:
    """Lines on the kept or removed files.

    words    nothing, or "clear"

    Raises: InputError for another word, and for a folder that cannot be removed.
    """
    if words not in ([], [CLEAR]):
        raise InputError(f"--cache {' '.join(words)!r} is not allowed; allowed: --cache alone, or --cache {CLEAR}")
    folder, other = Path(user_cache_dir("endotsr")) / "kernels", os.environ.get("NUMBA_CACHE_DIR")
    versions = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    size = sum(map(_bytes, versions)) / 1e6
    found = f"{plain_line(str(folder))}: compiled kernels of {len(versions)} versions of this package, {size:.0f} MB"
    lines = [found]
    if other:
        lines.append(f"{plain_line(other)}: compiled kernels, {_bytes(Path(other)) / 1e6:.0f} MB (NUMBA_CACHE_DIR)")
    if words:
        try:
            for version in versions:
                shutil.rmtree(version)
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be removed: {error.strerror or error}") from None
        lines[0] += "; removed"
    return lines


def _bytes(folder: Path) -> int:
    """Size of all files below a folder; links are not followed."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())
