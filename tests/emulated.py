"""The package for aarch64 in a user-mode emulator, on a Debian machine of another architecture.

    python tests/emulated.py make FOLDER            fetch the emulator, an interpreter and wheels into FOLDER
    python tests/emulated.py run FOLDER WORDS ...   run this interpreter, with the package of this repository
    python tests/emulated.py golden FOLDER          golden cases: made there, judged here

`make` needs apt, dpkg and the network, and no rights: nothing is installed. Emulated code is some ten times as slow.
"""

import os
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHON = "3.11"  # of Debian 12
TAGS = [f"manylinux_2_{minor}_aarch64" for minor in (17, 24, 26, 27, 28, 31, 34)] + ["manylinux2014_aarch64"]
PACKAGES = (f"python{PYTHON}", "libstdc++6", "libgomp1")  # what wheels take from the system
APT = """Dir::State "{apt}";
Dir::State::status "{apt}/status";
Dir::Cache "{apt}";
APT::Architecture "arm64";
APT::Architectures {{ "arm64"; }};
"""


def make(folder: Path) -> None:
    """Fetch everything and unpack it."""
    apt = folder / "apt"
    for part in ("lists/partial", "archives/partial"):
        (apt / part).mkdir(parents=True, exist_ok=True)
    (apt / "status").touch()
    (apt / "apt.conf").write_text(APT.format(apt=apt), encoding="utf-8")
    subprocess.run(["apt-get", "download", "qemu-user-static"], cwd=apt, check=True)
    foreign = os.environ | {"APT_CONFIG": str(apt / "apt.conf")}
    subprocess.run(["apt-get", "-q", "update"], env=foreign, check=True)
    install = ["apt-get", "-q", "-y", "--no-install-recommends", "--download-only", "install"]
    subprocess.run([*install, *PACKAGES], env=foreign, check=True)
    unpack([*apt.glob("*.deb")], folder / "emulator")
    unpack([*(apt / "archives").glob("*.deb")], folder / "root")
    fetch_wheels(folder)


def unpack(packages: list[Path], target: Path) -> None:
    """Debian packages as files."""
    for package in packages:
        subprocess.run(["dpkg", "-x", package, target], check=True)


def fetch_wheels(folder: Path) -> None:
    """The dependencies of the package, unpacked side by side."""
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    words = ["--only-binary=:all:", "--python-version", PYTHON, "--implementation", "cp", "--dest", folder / "wheels"]
    tags = [word for tag in TAGS for word in ("--platform", tag)]
    subprocess.run([sys.executable, "-m", "pip", "download", "-q", *words, *tags, *needed], check=True)
    for wheel in (folder / "wheels").glob("*.whl"):
        with zipfile.ZipFile(wheel) as packed:
            packed.extractall(folder / "site")


def run(folder: Path, words: list[str]) -> int:
    """The exit code of the emulated interpreter with these words."""
    emulator = folder / "emulator/usr/bin/qemu-aarch64-static"
    path = os.pathsep.join([str(folder / "site"), str(ROOT / "reference")])
    environment = os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / "cache")}
    interpreter = [emulator, "-L", folder / "root", folder / "root/usr/bin" / f"python{PYTHON}"]
    return subprocess.run([*interpreter, *words], env=environment).returncode


def golden(folder: Path) -> int:
    """Outputs of the emulated package, judged by that of this machine; 0 = every case passes."""
    with tempfile.TemporaryDirectory() as outputs:
        code = run(folder, ["-m", "endotsr", "golden", "reference", outputs, "--precision", "float64"])
        judge = [sys.executable, "-m", "endotsr", "golden", "judge", outputs, "--precision", "float64", "--level", "4"]
        return code or subprocess.run(judge, cwd=ROOT).returncode


def main(words: list[str]) -> int:
    """The command."""
    if len(words) < 2 or words[0] not in ("make", "run", "golden"):
        print(__doc__)
        return 2
    folder = Path(words[1]).resolve()
    if words[0] == "make":
        make(folder)
        return 0
    return run(folder, words[2:]) if words[0] == "run" else golden(folder)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
