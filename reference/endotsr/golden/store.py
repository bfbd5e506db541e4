"""The folder `golden/`: where it is, how it is written, how it is read and checked."""

import functools
import hashlib
import json
import platform
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.golden.format import (
    SCHEMAS,
    Case,
    FileEntry,
    FlagNote,
    Manifest,
    read_struct,
    schema_text,
    to_json,
)
from endotsr.golden.negative import Negative
from endotsr.golden.npy import Refused, header_of, npy_bytes, read_plain
from endotsr.golden.solve import Solved


class Golden(NamedTuple):
    """Cases whose files have the checksums of the manifest."""

    folder: Path
    manifest: Manifest
    cases: list[Case]

    @property
    def short_version(self) -> str:
        """major.minor, as in a claim."""
        return ".".join(self.manifest.version.split(".")[:2])

    def array(self, case: Case, file: str) -> NDArray:
        """An input or an expected output by its path within the case."""
        return _loaded(self.folder / "cases" / case.family / case.case / file)


@functools.cache
def _loaded(path: Path) -> NDArray:
    """Read once; the array cannot be written to."""
    return read_plain(path)


def golden_folder(given: Path | None = None) -> Path:
    """The folder named, else `golden/` of the source tree, else of the working folder."""
    places = [given] if given else [Path(__file__).parents[3] / "golden", Path("golden")]
    for place in places:
        if (place / "VERSION").is_file():
            return place.resolve()  # a caller may change its working folder
    raise InputError(f"{places[-1]}: no golden folder (no file VERSION); name it with --golden")


def machine_class() -> str:
    """On machines of one class the reference gives the same bits."""
    import llvmlite.binding
    import numba

    return (
        f"{platform.machine()} {llvmlite.binding.get_host_cpu_name()} numpy {np.__version__} numba {numba.__version__}"
    )


def rendered_files(solved: list[Solved], negatives: dict[str, Negative], version: str) -> dict[str, bytes]:
    """Every generated file by its path within golden/, the manifest last."""
    files: dict[str, bytes] = {}
    for one in solved:
        root = f"cases/{one.case.family}/{one.case.case}"
        files[f"{root}/case.json"] = to_json(one.case).encode()
        for name, array in one.inputs.items():
            files[f"{root}/inputs/{name}.npy"] = npy_bytes(array)
        files |= {f"{root}/{path}": npy_bytes(array) for _, path, array in one.files()}
    files |= {f"schemas/{name}.schema.json": schema_text(kind).encode() for name, kind in SCHEMAS.items()}
    files["negative/flags.json"] = _flags_text(solved, negatives).encode()
    families: dict[str, tuple[str, ...]] = {}
    for one in solved:
        families[one.case.family] = (*families.get(one.case.family, ()), one.case.case)
    manifest = Manifest(
        version=version,
        machine=machine_class(),
        families=families,
        flags={n.name: FlagNote(title=n.title, wrong=n.wrong) for n in negatives.values()},
        files=tuple(_entry(path, data) for path, data in files.items()),
    )
    return files | {"manifest.json": to_json(manifest).encode()}


def _flags_text(solved: list[Solved], negatives: dict[str, Negative]) -> str:
    rows = [
        {
            "flag": n.name,
            "title": n.title,
            "wrong": n.wrong,
            "made_for": [s.case.name for s in solved if n.name in s.case.flags],
            "also_shown_by": [s.case.name for s in solved if n.name in s.case.mistakes and n.name not in s.case.flags],
        }
        for n in negatives.values()
    ]
    return json.dumps(rows, indent=1) + "\n"


def _entry(path: str, data: bytes) -> FileEntry:
    digest = hashlib.sha256(data).hexdigest()
    if not path.endswith(".npy"):
        return FileEntry(path=path, sha256=digest, bytes=len(data))
    header = header_of(data)
    return FileEntry(
        path=path, sha256=digest, bytes=len(data), offset=header.offset, dtype=header.dtype, shape=header.shape
    )


def read_golden(folder: Path, *, verify: bool = True) -> Golden:
    """Manifest and cases. Raises InputError naming the file that is missing, damaged or not of this format."""
    try:
        manifest = read_struct(folder / "manifest.json", Manifest)
        version = (folder / "VERSION").read_text().strip()
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{folder / 'manifest.json'}: cannot be read: {error}") from None
    if version != manifest.version:
        raise InputError(f"{folder}: VERSION says {version}, manifest.json {manifest.version}")
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
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; the golden folder is incomplete") from None
    if hashlib.sha256(data).hexdigest() != entry.sha256:
        raise InputError(f"{path}: differs from the checksum in manifest.json; the golden folder is damaged")


def plain_or_none(path: Path) -> NDArray | None:
    """An array of the folder, None if it is missing or no plain array."""
    try:
        return read_plain(path)
    except Refused:
        return None
