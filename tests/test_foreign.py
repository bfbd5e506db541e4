"""The package on a system like Windows: the shim shows what it should, and a part of the tests passes under it."""

import sys

import pytest

import foreign

pytestmark = pytest.mark.skipif(not foreign.Path("/proc/self/fd").exists(), reason="open files are found in /proc")

# Of every kind of promise: locks, links, records, memory, the text of files, a closed pipe, files replaced whole.
CHOSEN = (
    "tests/port/judge/test_hostile.py",
    "tests/clips/sequences/test_frame_store.py",
    "tests/studies/sweeps/test_capacity.py",
    "tests/faults/test_checkpoints.py",
    "tests/cli/test_cli_run_folder.py",
    "tests/cli/test_cli_train.py::test_a_run_is_trained_by_one_process_alone",
    "tests/cli/test_cli_train.py::test_a_reader_that_left_is_no_success",
)
SEEN = """
import errno, os, shutil, sys, tempfile
from pathlib import Path
import endotsr.training.runs.files as files
assert os.name == "posix" and files.os.name == "nt" and files.sys.platform == "win32"
assert not hasattr(files.os, "O_NOFOLLOW") and hasattr(os, "O_NOFOLLOW")
folder = Path(tempfile.mkdtemp())
one, other = folder / "one", folder / "other"
one.write_text("a\\n")
assert one.read_bytes() == b"a\\n", "text of other code is left alone"
scope = {"__name__": "endotsr.made_up", "one": one, "other": other, "folder": folder}
exec("one.write_text('\\u00e4\\\\n')", scope)
assert one.read_bytes() == b"\\xe4\\r\\n"
try:
    exec("import fcntl", scope)
except ImportError:
    pass
else:
    raise AssertionError("fcntl is there")
with one.open():
    for act in ("one.unlink()", "one.replace(other)", "import os; os.replace(one, other)",
                "import shutil; shutil.rmtree(folder)"):
        try:
            exec(act, scope)
        except PermissionError:
            continue
        raise AssertionError(act)
exec("one.replace(other); import shutil; shutil.rmtree(folder)", scope)
assert not folder.exists()
"""


def test_the_foreign_system_is_foreign_to_the_package_alone():
    assert foreign.python([sys.executable, "-c", SEEN]).returncode == 0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_part_of_the_tests_passes_on_a_foreign_system():
    done = foreign.run(*CHOSEN, kept=True)
    assert done.returncode == 0, done.stdout[-4000:]
