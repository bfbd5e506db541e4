"""`endotsr --cache`: show or remove the package's files outside run folders.

These are the compiled kernels, one folder per state of their sources and version of Numba, and the flows of clips whose
masks are drawn. Older folders of kernels are not read again. A folder in NUMBA_CACHE_DIR is shown but never removed.
"""

import os
import shutil
from pathlib import Path

from platformdirs import user_cache_dir

from endotsr.clips.flow.clip_flows import flow_folder
from endotsr.errors import InputError
from endotsr.untrusted.names import plain_line

CLEAR = "clear"


def kept(words: list[str]) -> list[str]:
    """Lines on the kept or removed files.

    words    nothing, or "clear"

    Raises: InputError for another word, and for a folder that cannot be removed.
    """
    if words not in ([], [CLEAR]):
        raise InputError(f"--cache {' '.join(words)!r} is not allowed; use --cache alone, or --cache {CLEAR}")
    folder, other, flows = Path(user_cache_dir("endotsr")) / "kernels", os.environ.get("NUMBA_CACHE_DIR"), flow_folder()
    versions = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    lines = [_line(folder, f"compiled kernels of {len(versions)} versions of this package", versions)]
    if flows.is_dir():
        lines.append(_line(flows, f"flows of {len(list(flows.glob('*.npy')))} clips", [flows]))
        versions.append(flows)
    if words:
        try:
            for version in versions:
                shutil.rmtree(version)
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be removed: {error.strerror or error}") from None
        lines = [f"{line}; removed" for line in lines]
    return [*lines, f"{_line(Path(other), 'compiled kernels', [Path(other)])} (NUMBA_CACHE_DIR)"] if other else lines


def _line(place: Path, what: str, folders: list[Path]) -> str:
    return f"{plain_line(str(place))}: {what}, {sum(map(_bytes, folders)) / 1e6:.0f} MB"


def _bytes(folder: Path) -> int:
    """Size of all files below a folder; links are not followed."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())
