"""Python for the chapters that run in their page, in a folder: python docs/make.py live.fetch [FOLDER] [--from DIR]

FOLDER is docs/_static/pyodide by default, which the build of the book copies; for a book that is built already, name
its folder `_static/pyodide`. The files of Pyodide, NumPy and Matplotlib come from the host that publishes Pyodide or,
without a network, from DIR. Each has to have the SHA-256 of `docs/pages/live/supply.json`, and each package that of
Pyodide's own lock file. They are stored as scripts, which a page opened from a folder may read.
"""

import argparse
import base64
import hashlib
import json
import sys
import urllib.request
from pathlib import Path

from pages.live.supply import LOCK, Supply, needed, supply

DOCS = Path(__file__).parents[2]
FILLED = "filled.js"  # written last: without it, the page does not use the folder
SECONDS = 60


def content_of(name: str, host: str, source: Path | None) -> bytes:
    """The bytes of a file, from a folder or from the host.

    Raises: SystemExit with the reason.
    """
    try:
        if source is not None:
            return (source / name).read_bytes()
        with urllib.request.urlopen(host + name, timeout=SECONDS) as reply:
            return reply.read()
    except OSError as error:
        remedy = "name a folder that holds the files with --from DIR" if source is None else "add it to the folder"
        sys.exit(f"{name}: {error}; {remedy}")


def checked(name: str, content: bytes, expected: str) -> bytes:
    """The content, if it has the expected SHA-256.

    Raises: SystemExit otherwise.
    """
    found = hashlib.sha256(content).hexdigest()
    if found != expected:
        sys.exit(f"{name}: SHA-256 {found}, not {expected}; it is not the file of this version of Pyodide")
    return content


def check_lock(lock: dict, table: Supply) -> None:
    """Compare the table with Pyodide's own lock file.

    Raises: SystemExit if a package differs.
    """
    pinned = {name: file.sha256 for name, file in table.files.items()}
    for name, sha256 in needed(lock, table.packages).items():
        if pinned.get(name) != sha256:
            sys.exit(f"{name}: supply.json has SHA-256 {pinned.get(name)}, the lock file of Pyodide {sha256}")


def fill(folder: Path, source: Path | None) -> int:
    """Write all files as scripts into the folder. Returns the bytes of the files.

    Raises: SystemExit if a file is absent or differs; the folder is then not used.
    """
    table = supply()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / FILLED).unlink(missing_ok=True)
    for name in sorted(table.files, key=lambda name: name != LOCK):  # the lock file first
        content = checked(name, content_of(name, table.host, source), table.files[name].sha256)
        if name == LOCK:
            check_lock(json.loads(content), table)
        script = f"endotsrLive.keep({json.dumps(name)}, {json.dumps(base64.b64encode(content).decode())});\n"
        (folder / f"{name}.js").write_text(script, encoding="ascii", newline="\n")
    (folder / FILLED).write_text(f"// Pyodide {table.version}\n", encoding="ascii", newline="\n")
    return table.size


def main(words: list[str]) -> None:
    """Fill the folder and print its size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=DOCS / "_static" / "pyodide", metavar="FOLDER")
    parser.add_argument("--from", dest="source", type=Path, metavar="DIR", help="folder with the files of Pyodide")
    options = parser.parse_args(words)
    print(f"{options.folder}: {fill(options.folder, options.source) / 1e6:.1f} MB, every SHA-256 as published")
