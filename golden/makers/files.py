"""The generated files of `golden/` as bytes: cases, schemas, the list of mistakes, the manifest.

Cases and mistakes already in the manifest keep their position, and new ones follow in the order of the families. A new
version of the vectors therefore differs from the last one only by additions and changes.
"""

import hashlib
import json
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from endotsr.method.kernels.target import compiled_for
from endotsr.port.judge.format import Case, FileEntry, FlagNote, Manifest, read_struct, schema_text, to_json
from endotsr.port.judge.npy import header_of, npy_bytes
from endotsr.port.judge.schemas import SCHEMAS
from makers.solve import Solved
from makers.wrong import WrongPort


def machine_class() -> str:
    """The class of this machine; the reference is bitwise reproducible within a class."""
    import numba

    return f"{platform.machine()} {compiled_for()} numpy {np.__version__} numba {numba.__version__}"


class CaseFiles(NamedTuple):
    """A case, and its arrays as bytes by their path within the case: inputs, then expected values."""

    case: Case
    arrays: dict[str, bytes]


def fresh_files(one: Solved) -> CaseFiles:
    """The files of a case that was computed."""
    inputs = {f"inputs/{name}.npy": npy_bytes(array) for name, array in one.inputs.items()}
    return CaseFiles(one.case, inputs | {path: npy_bytes(array) for _, path, array in one.files()})


def stored_files(folder: Path, published: Manifest, name: str) -> CaseFiles:
    """The files of a case of the folder, in the order of the manifest."""
    root = f"cases/{name}/"
    paths = [e.path.removeprefix(root) for e in published.files if e.path.startswith(root) and e.path.endswith(".npy")]
    case = read_struct(folder / root / "case.json", Case)
    return CaseFiles(case, {path: (folder / root / path).read_bytes() for path in paths})


def rendered_files(
    cases: list[CaseFiles], wrong_ports: dict[str, WrongPort], version: str, published: Manifest | None
) -> dict[str, bytes]:
    """Every generated file by its path in golden/, in the order of the published manifest, which is last."""
    solved, wrong_ports = _in_published_order(cases, wrong_ports, published)
    files: dict[str, bytes] = {}
    for one in solved:
        root = f"cases/{one.case.family}/{one.case.case}"
        mistakes = {flag: one.case.mistakes[flag] for flag in wrong_ports if flag in one.case.mistakes}
        files[f"{root}/case.json"] = to_json(msgspec.structs.replace(one.case, mistakes=mistakes)).encode()
        files |= {f"{root}/{path}": data for path, data in one.arrays.items()}
    files |= {f"schemas/{name}.schema.json": schema_text(kind).encode() for name, kind in SCHEMAS.items()}
    files["negative/flags.json"] = _flags_text(solved, wrong_ports).encode()
    families: dict[str, tuple[str, ...]] = {}
    for one in solved:
        families[one.case.family] = (*families.get(one.case.family, ()), one.case.case)
    manifest = Manifest(
        version=version,
        machine=machine_class() if published is None else published.machine,
        families=families,
        flags={flag: FlagNote(title=w.title, wrong=w.wrong) for flag, w in wrong_ports.items()},
        files=tuple(_entry(path, data) for path, data in files.items()),
    )
    return files | {"manifest.json": to_json(manifest).encode()}


def _in_published_order(
    solved: list[CaseFiles], wrong_ports: dict[str, WrongPort], published: Manifest | None
) -> tuple[list[CaseFiles], dict[str, WrongPort]]:
    if published is None:
        return solved, wrong_ports
    paths = [entry.path.split("/") for entry in published.files]
    cases = [f"{path[1]}/{path[2]}" for path in paths if path[0] == "cases" and path[-1] == "case.json"]
    by_name = {one.case.name: one for one in solved}
    flags = _places_kept(wrong_ports, published.flags)
    return [by_name[name] for name in _places_kept(by_name, cases)], {flag: wrong_ports[flag] for flag in flags}


def _places_kept(names: Iterable[str], published: Iterable[str]) -> list[str]:
    """The names in the published order, new ones last."""
    place = {name: k for k, name in enumerate(published)}
    return sorted(names, key=lambda name: place.get(name, len(place)))


def _flags_text(solved: list[CaseFiles], wrong_ports: dict[str, WrongPort]) -> str:
    rows = []
    for flag, wrong_port in wrong_ports.items():
        made_for = [one.case.name for one in solved if flag in one.case.flags]
        shown = [one.case.name for one in solved if _shows(one, flag) and flag not in one.case.flags]
        rows.append({"flag": flag, "title": wrong_port.title, "wrong": wrong_port.wrong, "made_for": made_for,
                     "also_shown_by": shown})  # fmt: skip
    return json.dumps(rows, indent=1) + "\n"


def _shows(one: CaseFiles, flag: str) -> bool:
    return flag in one.case.mistakes and bool(one.case.mistakes[flag].shows)


def _entry(path: str, data: bytes) -> FileEntry:
    digest = hashlib.sha256(data).hexdigest()
    if not path.endswith(".npy"):
        return FileEntry(path=path, sha256=digest, bytes=len(data))
    header = header_of(data)
    return FileEntry(
        path=path, sha256=digest, bytes=len(data), offset=header.offset, dtype=header.dtype, shape=header.shape
    )
