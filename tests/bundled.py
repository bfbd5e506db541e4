"""What the wheel of PyAV holds, from the files that are installed: python tests/bundled.py

Prints the licence that each library of FFmpeg states, the libraries beside it, those of them under the GPL, and the
encoders of FFmpeg that `clips/formats/film_file.py` asks for.
"""

from pathlib import Path

import av
from av._core import library_meta
from av.codec import Codec
from av.codec.codec import UnknownCodecError

from endotsr.clips.formats.film_file import H264, VP9

UNDER_GPL = ("x264", "x265", "xvid", "rubberband", "vidstab")


def bundled() -> list[str]:
    """Names of the libraries in the wheel of PyAV; none where it was built on the FFmpeg of the system."""
    package = Path(av.__file__).parent
    folders = [package.with_name("av.libs"), package / ".dylibs", package]
    files = {file.name for folder in folders for kind in ("*.so*", "*.dylib", "*.dll") for file in folder.glob(kind)}
    return sorted(name for name in files if not any(part in name for part in ("abi3", "cpython", ".pyd")))


def under_gpl(names: list[str]) -> list[str]:
    """Those that are known to be under the GPL."""
    return [name for name in names if any(part in name.lower() for part in UNDER_GPL)]


def encodes(name: str) -> bool:
    """Whether FFmpeg has this encoder."""
    try:
        return bool(Codec(name, "w"))
    except UnknownCodecError:
        return False


if __name__ == "__main__":
    names = bundled()
    print(f"PyAV {av.__version__}")
    for name, about in library_meta.items():
        print(f"{name} {'.'.join(map(str, about['version']))}: {about['license']}")
    print("libraries:", ", ".join(names) or "those of the system")
    print("under the GPL:", ", ".join(under_gpl(names)) or "none")
    print("encoders:", ", ".join(encoder.name for encoder in (*H264, *VP9) if encodes(encoder.name)))
