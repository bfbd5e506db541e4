"""An edited kernel is never stale, and what is compiled serves every installation of the same sources."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

import endotsr
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.kernel_cache import kernel_folder, kernel_source_hash, kernel_sources

PACKAGE = Path(endotsr.__file__).parent
COMPILES = re.compile(r"^from endotsr\.method\.kernels\.jit import .*\bjit|^from numba\.extending|njit", re.MULTILINE)
PROGRAM = """
import numpy as np
from endotsr.method.equations.deformation import deformation_forward
weight, centre, width = np.ones((10, 1, 1)), np.zeros((10, 1, 1)), np.ones((10, 1, 1))
print(repr(deformation_forward(weight, centre, width, 0.9)[0][0, 0].item()))
"""


def process(folder: Path, cache: Path, **variables: str) -> subprocess.CompletedProcess:
    """A process that finds the package in `folder` and is to keep its kernels in `cache`; prints 2^(-u^2 / ln 2)."""
    environment = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT")}
    environment |= {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(cache)} | variables
    return subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)


def answer(folder: Path) -> float:
    """What such a process prints."""
    return float(process(folder, folder / "cache").stdout)


def copy_package(folder: Path) -> None:
    """The package in `folder`, with no compiled code beside it."""
    shutil.copytree(PACKAGE, folder / "endotsr", ignore=shutil.ignore_patterns("__pycache__"))


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> tuple[Path, float]:
    """A folder with the package and the kernels of `PROGRAM`, and what it prints. Tests change copies alone."""
    folder = tmp_path_factory.mktemp("installed")
    copy_package(folder)
    return folder, answer(folder)


def test_an_edit_of_a_file_that_a_kernel_inlines_is_never_stale(installed, tmp_path):
    """Numba itself looks only at the file that holds the kernel; here another one changes."""
    kept, before = installed
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    kernels = set((tmp_path / "cache").rglob("*.nbi"))
    file = tmp_path / "endotsr" / "method" / "kernels" / "exponential.py"
    text = file.read_text(encoding="utf-8")
    assert text.count("+ np.float64(1)\n") == 1
    file.write_text(text.replace("+ np.float64(1)\n", "+ np.float64(3)\n"), encoding="utf-8")
    u = 0.81 / 1.0001
    scale = 2.0 ** np.trunc(-u * u / np.log(2))
    assert answer(tmp_path) - before == 2 * scale
    assert kernels and kernels < set((tmp_path / "cache").rglob("*.nbi"))


def test_another_installation_of_the_same_sources_compiles_nothing(installed, tmp_path):
    """Another environment or clone has other paths and other times of its files."""
    (kept, before), cache = installed, tmp_path / "cache"
    shutil.copytree(kept / "cache", cache)
    times = {file: file.stat().st_mtime_ns for file in cache.rglob("*.nb?")}
    copy_package(tmp_path / "other")
    for file in (tmp_path / "other").rglob("*.py"):
        os.utime(file, (1e9, 1e9))
    assert float(process(tmp_path / "other", cache).stdout) == before
    assert times and times == {file: file.stat().st_mtime_ns for file in cache.rglob("*.nb?")}


def test_a_chosen_folder_holds_the_kernels_of_every_version(folder):
    """In NUMBA_CACHE_DIR too, so an edit is not stale there either."""
    assert kernel_folder() == folder / kernel_source_hash()


def test_a_cache_that_cannot_be_written_is_said_and_none_grows_beside_the_sources(installed, tmp_path):
    """Numba's own second choice is the folder of the source: a cache that knows nothing of other files."""
    folder, value = installed
    (tmp_path / "no_folder").write_text("a file")
    done = process(folder, tmp_path / "no_folder")
    assert float(done.stdout) == value
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"endotsr: warning: {tmp_path / 'no_folder'}") and "recompiled at every start" in line
    assert "set NUMBA_CACHE_DIR" in line
    assert not list((folder / "endotsr").rglob("*.nb?"))


def test_kernels_that_numba_does_not_keep_are_compiled_and_used(installed, tmp_path):
    """Without optimisation; Numba warns with the name of the file."""
    folder, value = installed
    plain = process(folder, tmp_path, NUMBA_OPT="0")
    assert float(plain.stdout) == value
    assert "Cannot cache compiled function" in plain.stderr


def plus_one(x):
    """A kernel whose result tells the dtype that it was compiled for."""
    return x + 1


FINE = 0.1  # no float32 has this value


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_two_processes_that_save_at_once_never_give_one_name_to_two_dtypes(folder):
    """Both have read the index before one of them writes it, and the one whose index stays writes its code first."""
    single, double = jit(plus_one), jit(plus_one)
    files, before = single._cache._cache_file, double._cache._cache_file
    save_data = files._save_data

    def save_after_the_other(name, data):
        before._load_index = dict
        double(1.0)
        save_data(name, data)

    files._save_data = save_after_the_other
    single(np.float32(1))
    found = jit(plus_one)
    assert found(FINE) == 1 + FINE and found.stats.cache_hits


@pytest.mark.parametrize("part", [0.0, 0.5])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_damaged_file_is_compiled_again(folder, ending, part):
    """As a crash of the system leaves it."""
    jit(plus_one)(1.0)
    (file,) = folder.rglob(f"*.{ending}")
    content = file.read_bytes()
    file.write_bytes(content[: int(part * len(content))])
    again = jit(plus_one)
    assert again(FINE) == 1 + FINE and not again.stats.cache_hits
    found = jit(plus_one)
    assert found(FINE) == 1 + FINE and found.stats.cache_hits


def test_a_full_disk_stops_no_kernel(folder, monkeypatch):
    def full(self, key, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    assert jit(plus_one)(1.0) == 2.0 and not list(folder.rglob("*.nb?"))


def test_every_file_that_compiles_is_under_the_hash():
    compiling = {file for file in PACKAGE.rglob("*.py") if COMPILES.search(file.read_text(encoding="utf-8"))}
    assert len(compiling) > 20
    assert compiling <= set(kernel_sources())
