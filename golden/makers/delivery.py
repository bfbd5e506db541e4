"""The vectors and the judge as files to hand on: an archive with its hash, a program, and a data wheel.

All are the same bytes for the same content: entries are sorted and carry a fixed date.
"""

import base64
import hashlib
import io
import zipfile
from pathlib import Path

from endotsr.errors import InputError
from endotsr.port.judge.archive import PACKAGE
from endotsr.port.judge.store import read_golden

PACKED = ("VERSION", "manifest.json", "README.md", "SETTINGS.md")
DATE = (2020, 1, 1, 0, 0, 0)
JUDGE = (
    "endotsr/__init__.py", "endotsr/errors.py", "endotsr/untrusted/__init__.py", "endotsr/untrusted/files.py",
    "endotsr/untrusted/names.py", "endotsr/untrusted/writing.py", "endotsr/port/__init__.py",
)  # fmt: skip
START = b"import sys\n\nfrom endotsr.port.judge.__main__ import main\n\nsys.exit(main(sys.argv[1:]))\n"
SHEBANG = b"#!/usr/bin/env python3\n"
METADATA = """Metadata-Version: 2.1
Name: {name}
Version: {version}
Summary: Conformance vectors of endotsr for ports of the method
License: Apache-2.0
"""
WHEEL = "Wheel-Version: 1.0\nGenerator: endotsr golden/make.py\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


def pack(golden: Path, outdir: Path) -> list[Path]:
    """Write the archive of the vectors with its hash, the judge, and the data wheel. Returns the files.

    Raises: InputError if the folder differs from its manifest.
    """
    manifest = read_golden(golden).manifest
    names = sorted({*PACKED, *(entry.path for entry in manifest.files)})
    vectors = zipped({name: (golden / name).read_bytes() for name in names})
    archive = f"{PACKAGE.replace('_', '-')}-{manifest.version}.zip"
    digest = f"{hashlib.sha256(vectors).hexdigest()}  {archive}\n"
    wheel = f"{PACKAGE}-{manifest.version}-py3-none-any.whl"
    files = {
        archive: vectors,
        f"{archive}.sha256": digest.encode(),
        f"{PACKAGE.replace('_', '-')}.pyz": SHEBANG + zipped(judge_files(golden)),
        wheel: zipped(wheel_files(vectors, archive, manifest.version)),
    }
    try:
        outdir.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            (outdir / name).write_bytes(data)
    except OSError as error:
        raise InputError(f"{outdir}: cannot be written: {error.strerror}") from None
    return [outdir / name for name in files]


def judge_files(golden: Path) -> dict[str, bytes]:
    """The judge by path in its archive, with `plain_msgspec` in the place of msgspec."""
    root = golden.parent / "reference"
    names = [*JUDGE, *(str(path.relative_to(root).as_posix()) for path in (root / "endotsr/port/judge").glob("*.py"))]
    plain = (Path(__file__).parent / "plain_msgspec.py").read_bytes()
    found = {name: (root / name).read_bytes() for name in names}
    return found | {"msgspec/__init__.py": plain, "__main__.py": START}


def wheel_files(vectors: bytes, archive: str, version: str) -> dict[str, bytes]:
    """The files of a wheel whose one package holds the archive."""
    info = f"{PACKAGE}-{version}.dist-info"
    files = {
        f"{PACKAGE}/__init__.py": b'"""The conformance vectors of endotsr, as one archive."""\n',
        f"{PACKAGE}/{archive}": vectors,
        f"{info}/METADATA": METADATA.format(name=PACKAGE.replace("_", "-"), version=version).encode(),
        f"{info}/WHEEL": WHEEL.encode(),
    }
    lines = [f"{name},sha256={_digest(data)},{len(data)}\n" for name, data in files.items()]
    return files | {f"{info}/RECORD": "".join([*lines, f"{info}/RECORD,,\n"]).encode()}


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def zipped(files: dict[str, bytes]) -> bytes:
    """A zip archive, the same bytes for the same files."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return buffer.getvalue()
