"""Only regular files are opened, up to a size; a read that does not return leaves Ctrl-C working."""

import os
import signal
import socket
import subprocess
import sys
import threading

import pytest

from endotsr.errors import InputError
from endotsr.untrusted import files
from endotsr.untrusted.files import in_threads, open_regular, read_bytes, read_text

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")


def test_a_regular_file_and_a_link_to_one_are_read(tmp_path):
    (tmp_path / "a").write_bytes(b"content")
    (tmp_path / "b").symlink_to("a")
    assert read_bytes(tmp_path / "a", 7) == read_bytes(tmp_path / "b", 7) == b"content"


def special(kind, path):
    if kind == "named pipe":
        os.mkfifo(path)
    elif kind == "socket":
        server = socket.socket(socket.AF_UNIX)
        server.bind(str(path))
        server.close()
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")


@pytest.mark.parametrize("kind", ["named pipe", "socket", "folder", "device"])
def test_anything_else_is_refused_at_once(kind, tmp_path):
    special(kind, tmp_path / "x")
    with pytest.raises(InputError, match=f"it is a {kind}; use a regular file"):
        read_bytes(tmp_path / "x", 100)


@pytest.mark.skipif(not hasattr(files.os, "O_NONBLOCK"), reason="the system of the package has no named pipes")
def test_a_file_that_became_a_pipe_after_the_look_is_refused_without_waiting(tmp_path, monkeypatch):
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    seen = os.stat(tmp_path / "a")
    monkeypatch.setattr(os, "stat", lambda path: seen)
    with pytest.raises(InputError, match="a named pipe"):
        open_regular(tmp_path / "pipe", 100)


def test_a_larger_file_is_refused_unread(tmp_path):
    with (tmp_path / "a").open("wb") as file:
        file.truncate(1 << 40)  # sparse
    with pytest.raises(InputError, match=r"has 1099511627776 bytes; use at most 1000"):
        read_bytes(tmp_path / "a", 1000)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is a folder of Linux")
def test_a_file_that_grows_while_it_is_read_is_refused():
    with pytest.raises(InputError, match="grew while it was read"):  # its size is 0 for the system
        read_bytes("/proc/self/status", 100)


@pytest.mark.parametrize("path", ["a\0b", "x" * 5000, "missing"])
def test_a_path_that_cannot_be_opened_is_one_error(path):
    with pytest.raises(InputError, match="cannot be read"):
        read_bytes(path, 10)


def test_text_that_is_not_utf_8_is_refused(tmp_path):
    (tmp_path / "a").write_bytes(b"ab\xff")
    with pytest.raises(InputError, match="not UTF-8 text: byte 2"):
        read_text(tmp_path / "a")
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfab")
    assert read_text(tmp_path / "a") == "ab"


def test_every_piece_of_work_is_done_and_the_first_error_raised():
    done = set()

    def work(k):
        done.add(k)
        if k in (5, 9):
            raise ValueError(k)

    with pytest.raises(ValueError, match="5"):
        in_threads(work, 20)
    assert done == set(range(20))
    in_threads(work, 0)


STALLED = """
import os, signal, threading
signal.signal(signal.SIGINT, signal.default_int_handler)  # it is ignored where a shell runs the tests in the background
from endotsr.untrusted.files import in_threads
def work(k):
    os.write(1, b"waiting\\n")  # in one piece: several threads write
    threading.Event().wait()  # a disk that does not answer
in_threads(work, 3)
"""


def test_a_read_that_does_not_return_can_be_interrupted():
    process = subprocess.Popen([sys.executable, "-c", STALLED], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == b"waiting\n"
    guard = threading.Timer(20, process.kill)
    guard.start()
    process.send_signal(signal.SIGINT)
    process.wait()
    guard.cancel()
    assert process.returncode != -signal.SIGKILL, "the process waited for its threads"
    process.communicate()
