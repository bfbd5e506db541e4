"""Marks in the containers MP4 (also MOV) and Matroska (also WebM) that change what the pictures of a video mean.

FFmpeg decodes the pictures and reads time, rotation, stereo pairs, colour and the shape of the pixels. This module
lists the fields of the video track, so that none is passed over: a crop, a projection of a sphere and encryption are
refused by name. In: the file. Out: notes on fields that are not known.
"""

from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple

from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.formats.stream_marks import stream_notes
from endotsr.untrusted.files import open_regular

LARGEST_FILE = 1 << 40  # bytes
LARGEST_HEADER = 1 << 28  # bytes of the boxes that describe the tracks
DEEPEST = 12  # levels of boxes
CROP = "a part of the picture is to be cut off, which calibrations and other programs may or may not have done: use"
CROP_REMEDY = f"{CROP} a file without this mark, and prepare --crop"
SPHERE = "the pictures are those of a sphere: use a perspective video"
CODECS = ("avc1", "avc3", "hvc1", "hev1", "av01", "vp08", "vp09", "mp4v", "jpeg", "mjpa", "mjpb", "png_", "apch",
          "apcn", "apcs", "apco", "ap4h", "ap4x", "s263", "xvid", "raw_", "2vuy", "v210", "dvc_", "dvcp")  # fmt: skip
MP4 = Inventory(
    "the boxes of the video track of an MP4 or MOV file",
    used={
        "mdhd stts ctts elst": "times of the pictures, and what an edit list hides",
        "tkhd": "rotation of the pictures, see --orientation",
        "stsd stsc stsz stco co64 stss mdia minf stbl trak edts dinf dref vmhd hdlr": "place and codec of the pictures",
        " ".join(CODECS): "codec of the pictures",
        "avcC hvcC av1C vpcC esds": "parameters of the codec",
        "pasp": "shape of the pixels",
        "colr": "colour: matrix and range; high dynamic range is refused",
        "fiel": "interlaced fields",
        "st3d": "stereo pairs side by side or stacked",
    },
    refused={
        "clap": CROP_REMEDY,
        "sv3d": SPHERE,
        "encv sinf": "the pictures are encrypted: use a file that is not",
        "vexu lhvC": "a second view in layers of the codec is not decoded: export each view as a file",
    },
    harmless={
        "btrt sgpd sbgp sdtp subs saiz saio cslg stdp padb free skip wide uuid udta meta tref name load": "it holds no"
        " picture and no time",
        "mdcv clli SmDm CoLL dvcC dvvC": "brightness of a display, which changes no stored value",
        "chrm gama ctab": "colour of a display of old QuickTime files; the values are read as sRGB",
        "gmhd gmin tapt clef prof enof text tmcd": "an aperture for players of QuickTime, which repeats pasp",
        "mvhd iods mvex mehd trex": "it concerns the whole file",
    },
)
MATROSKA = Inventory(
    "the fields of the video track of a Matroska or WebM file",
    used={
        "PixelWidth PixelHeight": "size of the pictures",
        "DisplayWidth DisplayHeight DisplayUnit AspectRatioType": "shape of the pixels",
        "FlagInterlaced FieldOrder": "interlaced fields",
        "StereoMode": "stereo pairs side by side or stacked",
        "Colour": "colour: matrix and range; high dynamic range is refused",
        "Projection": "rotation of the pictures, see --orientation",
        "ColourSpace": "form of pictures that are not compressed",
    },
    refused={
        "PixelCropTop PixelCropBottom PixelCropLeft PixelCropRight": CROP_REMEDY,
        "ContentEncryption": "the pictures are encrypted: use a file that is not",
        "OldStereoMode": "an outdated mark of a stereo pair: write the file again with StereoMode",
    },
    harmless={
        "AlphaMode": "transparency is reported where the pictures have it",
        "GammaValue FrameRate": "outdated; the times are those of the pictures",
        "Void CRC-32": "it holds no picture and no time",
    },
)
# Number of an element -> name. Names in capitals are opened; these lead to the fields of a video track.
ELEMENTS = {
    0x18538067: "SEGMENT", 0x1654AE6B: "TRACKS", 0xAE: "TRACKENTRY", 0xE0: "VIDEO", 0x6D80: "CONTENTENCODINGS",
    0x6240: "CONTENTENCODING", 0x5035: "ContentEncryption", 0xB0: "PixelWidth", 0xBA: "PixelHeight",
    0x54B0: "DisplayWidth", 0x54BA: "DisplayHeight", 0x54B2: "DisplayUnit", 0x54B3: "AspectRatioType",
    0x9A: "FlagInterlaced", 0x9D: "FieldOrder", 0x53B8: "StereoMode", 0x53B9: "OldStereoMode", 0x53C0: "AlphaMode",
    0x55B0: "Colour", 0x7670: "Projection", 0x2EB524: "ColourSpace", 0x2FB523: "GammaValue", 0x2383E3: "FrameRate",
    0x54AA: "PixelCropBottom", 0x54BB: "PixelCropTop", 0x54CC: "PixelCropLeft", 0x54DD: "PixelCropRight",
    0xEC: "Void", 0xBF: "CRC-32", 0x1F43B675: "CLUSTER",
}  # fmt: skip
WITH_BOXES = ("moov", "trak", "mdia", "minf", "stbl", "stsd", "edts")  # boxes that hold boxes
STSD, SAMPLE_ENTRY = 16, 86  # bytes before the inner boxes
VIDEO_HANDLER = b"vide"


class Box(NamedTuple):
    """A box or an element."""

    name: str
    start: int  # of its content
    end: int


def container_notes(path: Path) -> list[str]:
    """Notes on fields of the video tracks that are not known. Raises InputError naming a refused field."""
    with open_regular(path, LARGEST_FILE) as file:
        begin = file.read(12)
        length = file.seek(0, 2)
        if begin[:4] == b"\x1aE\xdf\xa3":
            return MATROSKA.noted(_matroska_fields(file, length), path.name)
        if begin[4:8] in (b"ftyp", b"moov", b"free", b"skip", b"wide", b"mdat", b"pnot"):
            return MP4.noted(_mp4_fields(file, length), path.name)
        return stream_notes(file, begin, path.name)


def without_index(path: Path) -> str:
    """The end of a message on an MP4 or MOV file that lacks its index, `moov`; "" for any other file."""
    with open_regular(path, LARGEST_FILE) as file:
        length = file.seek(0, 2)
        names = [box.name for box in _boxes(file, 0, length)]
    if "ftyp" not in names[:1] or "moov" in names:
        return ""
    return (
        "; the index of its pictures (moov) is missing, which is written at the end of a recording: the recording or"
        " the copy was cut off; copy the file again, or repair it with a program for such files, such as untrunc"
    )


def _mp4_fields(file: BufferedReader, length: int) -> dict[str, object]:
    """The boxes of the video tracks, with what decides: a crop that cuts nothing off is no crop."""
    moov = next((box for box in _boxes(file, 0, length) if box.name == "moov"), None)
    found: dict[str, object] = {}
    for track in _boxes(file, moov.start, moov.end) if moov and moov.end - moov.start <= LARGEST_HEADER else []:
        if track.name == "trak" and VIDEO_HANDLER in _content(file, track)[:4096]:
            for box in _all_boxes(file, track, 0):
                found[box.name] = found.get(box.name) or True
                if box.name in CODECS:
                    found["clap"] = found.get("clap") or _crop(file, box)
    return found


def _all_boxes(file: BufferedReader, box: Box, depth: int) -> Iterator[Box]:
    """The box, and the boxes in it."""
    yield box
    if depth > DEEPEST:
        return
    if box.name == "stsd":
        for entry in _boxes(file, box.start + STSD - 8, box.end):
            yield entry
            for inner in _boxes(file, entry.start + SAMPLE_ENTRY - 8, entry.end):
                if inner.name != "clap":
                    yield from _all_boxes(file, inner, depth + 1)
    elif box.name in WITH_BOXES:
        for inner in _boxes(file, box.start, box.end):
            yield from _all_boxes(file, inner, depth + 1)


def _boxes(file: BufferedReader, start: int, end: int) -> Iterator[Box]:
    """The boxes between two places of the file, as far as they are whole."""
    while start + 8 <= end:
        file.seek(start)
        head = file.read(16)
        size, name, skipped = int.from_bytes(head[:4]), head[4:8].decode("latin-1").replace(" ", "_"), 8
        if size == 1:
            size, skipped = int.from_bytes(head[8:16]), 16
        size = end - start if size == 0 else size
        if size < skipped or start + size > end or not name.isprintable():
            return
        yield Box(name, start + skipped, start + size)
        start += size


def _crop(file: BufferedReader, entry: Box) -> object:
    """Width and height of the clean aperture of a sample entry; False without one, or if it is the whole picture."""
    box = next((box for box in _boxes(file, entry.start + SAMPLE_ENTRY - 8, entry.end) if box.name == "clap"), None)
    if box is None:
        return False
    size = tuple(int.from_bytes(part) for part in _parts(_content(file, entry)[24:28], 2))
    numbers = [int.from_bytes(part) for part in _parts(_content(file, box)[:16], 4)]
    if len(numbers) < 4 or not numbers[1] or not numbers[3]:
        return True
    kept = numbers[0] / numbers[1], numbers[2] / numbers[3]
    return False if kept == size else f"{kept[0]:g}x{kept[1]:g}"


def _parts(data: bytes, size: int) -> list[bytes]:
    return [data[k : k + size] for k in range(0, len(data), size)]


def _content(file: BufferedReader, field: Box) -> bytes:
    file.seek(field.start)
    return file.read(min(field.end - field.start, LARGEST_HEADER))


def _matroska_fields(file: BufferedReader, length: int) -> dict[str, object]:
    """The elements in the description of the video tracks, with their values as numbers."""
    found: dict[str, object] = {}
    for field in _elements(file, 0, length, ()):
        file.seek(field.start)
        data = file.read(min(8, field.end - field.start))
        found[field.name] = found.get(field.name) or int.from_bytes(data) or (field.end - field.start > 8)
    return found


def _elements(file: BufferedReader, start: int, end: int, inside: tuple[str, ...]) -> Iterator[Box]:
    """The elements of the video tracks between two places."""
    while start < end and len(inside) < DEEPEST:
        number, at = _variable(file, start, keep=True)
        size, content = _variable(file, at, keep=False)
        name = ELEMENTS.get(number, f"element {number:X}")
        stop = end if size is None else content + size
        if number == 0 or (size == 0 and not name) or stop > end or name == "CLUSTER":
            return
        if name.isupper() and not name.startswith("CRC"):
            yield from _elements(file, content, stop, (*inside, name))
        elif "VIDEO" in inside or name == "ContentEncryption":
            yield Box(name, content, stop)
        start = stop


def _variable(file: BufferedReader, start: int, keep: bool) -> tuple[int, int]:
    """A number of variable length, with its mark if `keep`; None for an unknown size; and the place behind it."""
    file.seek(start)
    data = file.read(8)
    first = data[0] if data else 0
    width = 9 - first.bit_length()
    if first == 0 or len(data) < width:
        return 0, start + 8
    value = int.from_bytes(data[:width])
    kept = value if keep else value & ((1 << 7 * width) - 1)
    if not keep and kept == (1 << 7 * width) - 1:
        return None, start + width  # type: ignore[return-value]
    return kept, start + width
