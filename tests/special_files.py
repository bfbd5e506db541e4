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
