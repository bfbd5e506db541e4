"""The vectors as one archive: where it is looked for, and its content in a folder of this process."""

import atexit
import hashlib
import importlib.util
import io
import shutil
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

from endotsr.errors import InputError
from endotsr.untrusted.files import read_bytes, read_text
from endotsr.untrusted.names import relative_path

PACKAGE = "endotsr_golden"  # the package of the data wheel
PATTERN = "endotsr-golden-*.zip"
LARGEST = 1 << 28  # bytes of the archive, and of its content together
MOST = 20_000  # files


def archive_at_hand() -> Path | None:
    """An archive in the working folder, beside the running program, or in the data wheel; None without one.

    Raises: InputError if the first of these folders that has an archive has several.
    """
    package = importlib.util.find_spec(PACKAGE)
    inside = [Path(folder) for folder in (package.submodule_search_locations or [])] if package else []
    for folder in (Path(), Path(sys.argv[0]).parent, *inside):
        found = sorted(folder.glob(PATTERN))
        if len(found) > 1:
            names = ", ".join(path.name for path in found)
            raise InputError(f"{folder.resolve()}: has several archives of vectors: {names}; name one with --golden")
        if found:
            return found[0]
    return None


def unpacked(archive: Path) -> Path:
    """The content of an archive in a temporary folder, which is removed when the process ends.

    A file NAME.sha256 beside the archive is compared with it.
    Raises: InputError for a damaged or foreign archive, a wrong hash, an unsafe name, and more than MOST files or
            LARGEST bytes.
    """
    data = read_bytes(archive, LARGEST)
    beside = archive.with_name(f"{archive.name}.sha256")
    if beside.is_file() and read_text(beside).split()[:1] != [hashlib.sha256(data).hexdigest()]:
        raise InputError(f"{archive}: differs from the hash in {beside.name}; fetch both again")
    folder = Path(tempfile.mkdtemp(prefix="endotsr-golden-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    try:
        _extract(archive, data, folder)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{archive}: is no archive of vectors: {error}") from None
    return folder


def _extract(archive: Path, data: bytes, folder: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        entries = opened.infolist()
        if len(entries) > MOST or sum(entry.file_size for entry in entries) > LARGEST:
            raise InputError(f"{archive}: unpacks to more than {MOST} files or {LARGEST} bytes")
        for entry in entries:
            target = folder / relative_path(entry.filename, str(archive))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(opened.read(entry))
