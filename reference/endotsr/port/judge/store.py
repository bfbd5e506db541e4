"""The folder `golden/`: its location, reader and checks."""

import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.port.judge.archive import archive_at_hand, unpacked
from endotsr.port.judge.format import Case, FileEntry, Manifest, read_struct
from endotsr.port.judge.npy import LARGEST as LARGEST_ARRAY
from endotsr.port.judge.npy import read_plain
from endotsr.untrusted.files import read_bytes, read_text

WAYS = (
    "put the archive endotsr-golden-VERSION.zip into the working folder, install the wheel endotsr-golden, or name "
    "folder or archive with --golden (in Python golden=); `python golden/make.py pack DIR` in the repository of "
    "endotsr makes both"
)


class Golden(NamedTuple):
    """Manifest and cases; their files were compared with its checksums, unless `read_golden` was told not to."""

    folder: Path
    manifest: Manifest
    cases: list[Case]

    def array(self, case: Case, file: str) -> NDArray:
        """An input or an expected output by its path within the case."""
        return _loaded(self.folder / "cases" / case.family / case.case / file)

    def inputs(self, case: Case) -> dict[str, NDArray]:
        """Every input of a case by name, as stored."""
        return {name: self.array(case, array.file) for name, array in case.inputs.items()}


@functools.cache
def _loaded(path: Path) -> NDArray:
    """The array of a file, read once for the process: a later change of the file is not seen."""
    return read_plain(path)


def in_precision(inputs: Mapping[str, NDArray], precision: str) -> dict[str, NDArray]:
    """Copies of the inputs, real ones in the given precision (exact: they are float32 numbers)."""
    return {name: np.array(a, precision) if a.dtype.kind == "f" else np.array(a) for name, a in inputs.items()}


def golden_folder(given: Path | None = None) -> Path:
    """The named folder or archive, else `golden/` of the source tree or the working folder, else an archive at hand.

    An archive is unpacked into a temporary folder: see `archive`.
    Raises: InputError without vectors, with the ways to get them.
    """
    places = [given] if given else [Path(__file__).parents[4] / "golden", Path("golden")]
    for place in places:
        if (place / "VERSION").is_file():
            return place.resolve()  # the caller may change the working folder
    archive = given if given and given.is_file() else None if given else archive_at_hand()
    if archive:
        return unpacked(archive)
    raise InputError(f"{places[-1]}: no golden folder (no file VERSION); {WAYS}")


def read_golden(folder: Path, *, verify: bool = True) -> Golden:
    """Manifest and cases. Raises InputError with the name of a missing or damaged file, or of two versions.

    A file that the manifest does not list is not read, and so not refused.
    """
    try:
        manifest = read_struct(folder / "manifest.json", Manifest)
        version = read_text(folder / "VERSION").strip()
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{folder / 'manifest.json'}: cannot be read: {error}") from None
    if version != manifest.version:
        raise InputError(
            f"{folder}: VERSION says {version}, manifest.json {manifest.version}; take both from one release, or after"
            " a change of the cases run `python golden/make.py write`"
        )
    if verify:
        for entry in manifest.files:
            _verify(folder, entry)
    cases = []
    for family, names in manifest.families.items():
        for name in names:
            path = folder / "cases" / family / name / "case.json"
            try:
                cases.append(read_struct(path, Case))
            except (OSError, msgspec.DecodeError) as error:
                raise InputError(f"{path}: cannot be read: {error}") from None
    return Golden(folder, manifest, cases)


def _verify(folder: Path, entry: FileEntry) -> None:
    path = folder / entry.path
    try:
        data = read_bytes(path, LARGEST_ARRAY)
    except InputError as error:
        raise InputError(f"{error}; the golden folder is incomplete") from None
    if hashlib.sha256(data).hexdigest() != entry.sha256:
        raise InputError(f"{path}: differs from the checksum in manifest.json; the golden folder is damaged")
