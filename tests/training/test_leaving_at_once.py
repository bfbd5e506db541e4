"""A signal ends the process while compiled code runs, in which Python calls no handler."""

import signal
import subprocess
import sys

import pytest

from endotsr.training.runs import stopping

PROGRAM = """
import hashlib
from endotsr.training.runs import stopping
stopping.LONGEST_WAIT = 0.2
with stopping.signals_stop(), stopping.leaving_at_once(lambda: print("last words", flush=True), stopping.INTERRUPTED):
    try:
        print("begun", flush=True)
        hashlib.pbkdf2_hmac("sha256", b"a", b"b", 400_000_000)  # minutes without an instruction of Python
    except KeyboardInterrupt:  # arrived before the call; a callback from compiled code discards it
        hashlib.pbkdf2_hmac("sha256", b"a", b"b", 400_000_000)
print("ended", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send SIGTERM to another one on Windows")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP] if sys.platform != "win32" else [])
def test_a_signal_ends_the_process_inside_compiled_code(number):
    if signal.getsignal(number) == signal.SIG_IGN:
        pytest.skip(f"{number.name} is ignored here, as under nohup, and so by the process that the test starts")
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(number)
        said, _ = process.communicate(timeout=90)
    assert process.returncode == stopping.INTERRUPTED and said == "last words\n"


def test_a_block_that_ends_leaves_nothing_behind():
    before = signal.set_wakeup_fd(-1)
    try:
        with stopping.leaving_at_once(pytest.fail, 1):
            assert signal.set_wakeup_fd(-1) != -1
        assert signal.set_wakeup_fd(-1) == -1
    finally:
        signal.set_wakeup_fd(before)
