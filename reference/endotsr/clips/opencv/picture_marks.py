"""Fields of picture files beside their pixels: chunks of PNG and WebP, segments of JPEG, tags of TIFF and EXIF.

In: a path. Out: the fields as names with their values, as an inventory of the format reads them. A damaged file has
none: the reader of its pixels reports the fault.
"""

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.first_bytes import FIRST_BYTES, kind_of
from endotsr.untrusted.png import LARGEST_FILE

MOST_FIELDS = 4096
LARGEST_PROFILE = 1 << 22  # bytes, unpacked
EXIF_START, MPF_START, ICC_START = b"Exif\0\0", b"MPF\0", b"ICC_PROFILE\0"
ADOBE_START = b"Adobe"
ORIENTATION, EXIF_IFD, COLOUR_SPACE = 0x0112, 0x8769, 0xA001  # EXIF tags; orientation 1 = shown as it is stored
OTHER_SPACES = (2, 65535)  # Adobe RGB; uncalibrated, as cameras state it for Adobe RGB
GAMMA, PRIMARIES = 45455, (31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)  # of sRGB in a PNG
SAME_GAMMA, SAME = 0.1, 1000  # relative difference of gamma; difference of primaries, in these steps
BITMAP = ("bfType", "bfOffBits", "biSize", "biWidth", "biHeight", "biPlanes", "biBitCount", "biCompression",
          "biSizeImage", "biClrUsed", "biClrImportant")  # fmt: skip
SRGB_SPACES, CALIBRATED = (b"sRGB", b"Win "), b"\0\0\0\0"  # bV4CSType
WIDE_RANGE = {16: "PQ", 18: "HLG"}  # transfer functions of cICP


def picture_marks(path: Path) -> dict[str, Any]:
    """The fields of a picture file. A value of None or False is neutral: the field says what holds without it."""
    try:
        return marks_of(read_bytes(path, LARGEST_FILE))
    except InputError:
        return {}  # the reader of the pixels reports the fault


def marks_of(data: bytes) -> dict[str, Any]:
    """As `picture_marks`, from the content of the file."""
    try:
        return READERS[kind](data) if (kind := kind_of(data)) else {}
    except (struct.error, zlib.error, ValueError, IndexError, KeyError, OverflowError):
        pass  # the reader of the pixels reports the fault
    return {}


def _png(data: bytes) -> dict[str, Any]:
    """The first `MOST_FIELDS` chunks; their value is what a decoder would do with them."""
    found: dict[str, Any] = {}
    for kind, content in _chunks(data):
        value: Any = True
        if kind == "gAMA":
            value = abs(int.from_bytes(content) / GAMMA - 1) > SAME_GAMMA
        elif kind == "cHRM":
            stored = struct.unpack(">8I", content)
            value = any(abs(a - b) > SAME for a, b in zip(stored, PRIMARIES))
        elif kind == "iCCP":
            name, _, packed = content.partition(b"\0")
            value = not _is_srgb(name + zlib.decompressobj().decompress(packed[1:], LARGEST_PROFILE))
        elif kind == "pHYs":
            across, down = struct.unpack(">II", content[:8])
            value = across != down and f"{down}:{across}"
        elif kind == "cICP":
            value = content[0] != 1 and f"primaries {content[0]}"
            found["transfer"] = WIDE_RANGE.get(content[1])
        elif kind == "eXIf":
            found |= _of_exif(content)
        found[kind] = value
    if found.get("sRGB"):  # takes precedence
        found["gAMA"] = found["cHRM"] = False
    return found


def _chunks(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Kind and content of the chunks of a PNG."""
    start = len(FIRST_BYTES["PNG"][0])
    for _ in range(MOST_FIELDS):
        length = int.from_bytes(data[start : start + 4])
        kind = data[start + 4 : start + 8]
        if len(kind) < 4:
            return
        yield kind.decode("latin-1"), data[start + 8 : start + 8 + length]
        start += 12 + length


def _jpeg(data: bytes) -> dict[str, Any]:
    """Segments up to the pixels."""
    found: dict[str, Any] = {}
    place = 2
    for _ in range(MOST_FIELDS):
        while data[place] == 0xFF and data[place + 1] == 0xFF:
            place += 1
        marker = data[place + 1]
        if data[place] != 0xFF or marker in (0xDA, 0xD9):
            break
        content = data[place + 4 : place + 2 + int.from_bytes(data[place + 2 : place + 4])]
        if 0xE0 <= marker <= 0xEF:
            if content.startswith(EXIF_START):
                found["Exif"] = True
                found |= _of_exif(content[6:])
            elif content.startswith(MPF_START):
                found["MPF"] = True
            elif content.startswith(ICC_START):
                found["ICC_PROFILE"] = found.get("ICC_PROFILE") is not False and not _is_srgb(content)
            else:
                found["Adobe" if content.startswith(ADOBE_START) else f"APP{marker - 0xE0}"] = True
        elif marker == 0xFE:
            found["COM"] = True
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            found["SOF"] = True
        place += 2 + int.from_bytes(data[place + 2 : place + 4])
    return found


def _webp(data: bytes) -> dict[str, Any]:
    found: dict[str, Any] = {}
    place = 12
    for _ in range(MOST_FIELDS):
        kind = data[place : place + 4]
        if len(kind) < 4:
            break
        length = int.from_bytes(data[place + 4 : place + 8], "little")
        content = data[place + 8 : place + 8 + length]
        name = kind.decode("latin-1").strip()
        found[name] = not _is_srgb(content) if name == "ICCP" else True
        if name == "EXIF":
            found |= _of_exif(content.removeprefix(EXIF_START))
        place += 8 + length + length % 2
    return found


def _bitmap(data: bytes) -> dict[str, Any]:
    """The fields of the header of a BMP that say something beside the pixels, by their names at Microsoft."""
    found: dict[str, Any] = dict.fromkeys(BITMAP, True)
    length = int.from_bytes(data[14:18], "little")
    if length >= 40:
        across, down = struct.unpack_from("<ii", data, 38)
        found["biXPelsPerMeter"] = across != down and f"{down}:{across}"
    if length >= 108:
        space = data[14 + 56 : 14 + 60][::-1]
        ends = struct.unpack_from("<9i3I", data, 14 + 60)
        found["bV4CSType"] = space not in SRGB_SPACES and (space != CALIBRATED or any(ends)) and plain_space(space)
    return found


def plain_space(space: bytes) -> str:
    """The name of a colour space in a BMP."""
    return space.decode("latin-1") if space.isalpha() else "calibrated"


def _is_srgb(profile: bytes) -> bool:
    """Whether a profile describes sRGB by its name."""
    return any("sRGB".encode(code) in profile for code in ("ascii", "utf-16-be"))


def _of_exif(data: bytes) -> dict[str, Any]:
    """Orientation and colour space of EXIF data, as fields."""
    from PIL.Image import Exif

    warnings.filterwarnings("ignore", module=r"PIL\.")  # about metadata, without a file name
    exif = Exif()
    try:
        exif.load(data)
        orientation = exif.get(ORIENTATION, 1)
        space = exif.get_ifd(EXIF_IFD).get(COLOUR_SPACE)
    except Exception:  # Pillow passes on any error of its parser
        return {}
    return {"Orientation": orientation if orientation not in (0, 1) else False, "ColorSpace": space in OTHER_SPACES}


def _tags(data: bytes) -> dict[str, Any]:
    """Tags of the first directory of a TIFF, by their names in Pillow; numbers have the name `tag N`."""
    from PIL import TiffTags
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    warnings.filterwarnings("ignore", module=r"PIL\.")  # about metadata, without a file name
    stream = io.BytesIO(data)
    try:
        tags = ImageFileDirectory_v2(data[:8])
        stream.seek(tags.next)
        tags.load(stream)
        found = {TiffTags.lookup(number).name or f"tag {number}": tags[number] for number in tags}
    except Exception:  # Pillow passes on any error of its parser
        return {}
    if "Orientation" in found:
        found["Orientation"] = found["Orientation"] != 1 and found["Orientation"]
    if "ICCProfile" in found:
        found["ICCProfile"] = not _is_srgb(bytes(found["ICCProfile"]))
    return found


READERS = {"PNG": _png, "JPEG": _jpeg, "TIFF": _tags, "WebP": _webp, "BMP": _bitmap}
