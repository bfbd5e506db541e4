"""The files of Pyodide that a chapter needs, as `supply.json` pins them: name, SHA-256 and size."""

import json
from pathlib import Path
from typing import NamedTuple

TABLE = Path(__file__).with_name("supply.json")
LOCK = "pyodide-lock.json"


class File(NamedTuple):
    """A file of Pyodide."""

    sha256: str
    bytes: int


class Supply(NamedTuple):
    """The files by name, the packages to load, and the host that publishes them."""

    version: str
    host: str
    packages: list[str]
    files: dict[str, File]

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(file.bytes for file in self.files.values())


def supply() -> Supply:
    """The table `supply.json`."""
    read = json.loads(TABLE.read_text(encoding="utf-8"))
    return Supply(**read | {"files": {name: File(**file) for name, file in read["files"].items()}})


def needed(lock: dict, packages: list[str]) -> dict[str, str]:
    """Files of the packages and of all that they depend on, by name, with the SHA-256 of the lock file of Pyodide."""
    found: dict[str, str] = {}
    open_names = list(packages)
    while open_names:
        package = lock["packages"][open_names.pop()]
        if package["file_name"] not in found:
            found[package["file_name"]] = package["sha256"]
            open_names += package["depends"]
    return found
