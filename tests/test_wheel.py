"""The wheel holds the package, its data files and its licence, and nothing else."""

import ast
import email
import re
import sys
import zipfile
from pathlib import Path

import pytest

hatchling = pytest.importorskip(
    "hatchling.builders.wheel", reason="hatchling, which builds the wheel, is not installed"
)
ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "reference" / "endotsr"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The built wheel: name of every file -> content."""
    file = next(hatchling.WheelBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("wheel"))))
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_every_file_of_the_package_is_in_the_wheel(wheel):
    wanted = {
        f"endotsr/{file.relative_to(PACKAGE).as_posix()}": file.read_bytes()
        for file in PACKAGE.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert {"endotsr/results/views/viewer.html", "endotsr/results/views/viewer.js", "endotsr/py.typed"} <= {*wanted}
    assert {name: content for name, content in wheel.items() if name.startswith("endotsr/")} == wanted


def test_nothing_else_is_in_the_wheel(wheel):
    others = {name.partition("/")[2] for name in wheel if not name.startswith("endotsr/")}
    assert others == {"METADATA", "WHEEL", "RECORD", "entry_points.txt", "licenses/LICENSE"}


def test_the_metadata_is_complete(wheel):
    found = email.message_from_bytes(next(text for name, text in wheel.items() if name.endswith("/METADATA")))
    assert found["Name"] == "endotsr" and found["License-Expression"] == "Apache-2.0" and found["Requires-Python"]
    assert found["Summary"] and found["Author"] and len(found.get_all("Classifier")) > 5
    assert found["Description-Content-Type"] == "text/markdown" and "## Two commands" in found.get_payload()
    assert {"test", "docs", "mesh", "sfm", "peers", "cluster"} == {*found.get_all("Provides-Extra")}


# Distributions whose import has another name.
IMPORTED_AS = {"opencv-contrib-python-headless": "cv2", "pillow": "PIL", "scikit-image": "skimage", "pyyaml": "yaml"}
INDIRECT = {"llvmlite": "numba", "pytest": "test", "dask": "distributed"}  # comes with; pytest runs the tests of ports


def test_the_wheel_needs_what_the_package_imports_and_nothing_else(wheel):
    """What only tests and the programs of the repository import is no dependency of a user."""
    found = email.message_from_bytes(next(text for name, text in wheel.items() if name.endswith("/METADATA")))
    needed, extra = set(), set()
    for line in found.get_all("Requires-Dist"):
        name = re.match(r"[\w.-]+", line)[0]
        (extra if "extra ==" in line else needed).add(IMPORTED_AS.get(name, name))
    imported = set()
    for name, content in wheel.items():
        if name.endswith(".py"):
            for node in ast.walk(ast.parse(content)):
                if isinstance(node, ast.Import):
                    imported |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom):
                    imported.add((node.module or "").split(".")[0])
    imported -= {*sys.stdlib_module_names, "endotsr"}
    assert needed <= imported, f"nobody imports {needed - imported}"
    assert imported - needed - extra - {*INDIRECT} == set()
