"""Files that are put in the place of one that a reader expects: each function replaces the file at a path."""

import os


def pipe(path):
    path.unlink()
    os.mkfifo(path)


def device(path):
    path.unlink()
    path.symlink_to("/dev/zero")


def folder_there(path):
    path.unlink()
    path.mkdir()


def dangling(path):
    path.unlink()
    path.symlink_to("nowhere")


def huge(path):
    with path.open("r+b") as file:
        file.truncate(1 << 41)  # sparse


NO_FILES = {
    "missing": lambda path: path.unlink(),
    "named pipe": pipe,
    "device": device,
    "folder": folder_there,
    "dangling link": dangling,
    "huge": huge,
}
"""Faults after which there is no file that could be read."""

DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "no text": lambda path: path.write_bytes(b"\xff\xfe\x00" * 99),
    "deep": lambda path: path.write_text("[" * 100_000),
}
"""Faults of a whole file, whatever its format."""
