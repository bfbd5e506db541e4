"""Fields of AVI, MPEG transport streams and MPEG program streams that change what the pictures of a video mean.

As in `video_marks`: FFmpeg decodes the pictures, and this module lists the fields of the video track. Of a stream
without an index, the first part is looked at. In: the file. Out: the fields with their values, as an inventory reads
them.
"""

from collections.abc import Iterator
from io import BufferedReader
from typing import Any

from endotsr.clips.formats.inventory import Inventory
from endotsr.untrusted.json import Keys

LARGEST_HEADER = 1 << 20  # bytes of the description of a stream
LOOKED_AT = 1 << 22  # bytes of a stream without an index
MOST_CHUNKS = 4096
ENCRYPTED = "the pictures are encrypted: use a file that is not"
SECOND = "a second view of the same pictures is not decoded: export each view as a file"
AVI = Inventory(
    "the chunks of the video stream of an AVI file",
    used={
        "strh": "codec and pictures a second",
        "strf": "size and form of the pictures",
        "vprp": "shape of the pixels",
    },
    told={"rcFrame": "the pictures are meant for a part of a window; they are read whole"},
    harmless={
        "strd strn JUNK INFO ISMP IDIT": "it holds no picture and no time",
        "indx idx1 dmlh avih odml": "an index and totals, which FFmpeg checks or makes again",
    },
)
TRANSPORT = Inventory(
    "the descriptors of the video of an MPEG transport stream",
    used={"stream_type": "codec of the pictures"},
    refused={
        "transport_scrambling_control": ENCRYPTED,
        "MVC_extension MVC_operation_point stereoscopic_video_format stereoscopic_video_info": SECOND,
    },
    told={
        "CA": "the stream may be encrypted in parts",
        "auxiliary_video_stream": "a second stream, such as depth, is not read",
        "video_window": "the pictures are meant for a part of a window; they are read whole",
    },
    harmless={
        "video_stream AVC_video AVC_timing_HRD HEVC_video MPEG4_video hierarchy": "the coded pictures repeat it",
        "registration data_stream_alignment target_background_grid ISO_639_language system_clock"
        " multiplex_buffer_utilization copyright maximum_bitrate private_data_indicator smoothing_buffer STD"
        " stream_identifier transport_profile extension private_*": "it holds no picture and no time",
    },
)
PROGRAM = Inventory(
    "the parts of an MPEG program stream",
    used={"video": "codec and pictures, with their times"},
    refused={"PES_scrambling_control": ENCRYPTED},
    harmless={
        "pack": "the clock of the sender; the times are those of the pictures",
        "system_header program_stream_map directory": "it describes the parts, which are found without it",
        "padding private_1 private_2 audio end extended": "sound, subtitles and menus",
    },
)
TAGS = {2: "video_stream", 4: "hierarchy", 5: "registration", 6: "data_stream_alignment", 7: "target_background_grid",
        8: "video_window", 9: "CA", 10: "ISO_639_language", 11: "system_clock", 12: "multiplex_buffer_utilization",
        13: "copyright", 14: "maximum_bitrate", 15: "private_data_indicator", 16: "smoothing_buffer", 17: "STD",
        27: "MPEG4_video", 40: "AVC_video", 42: "AVC_timing_HRD", 47: "auxiliary_video_stream", 49: "MVC_extension",
        51: "MVC_operation_point", 52: "stereoscopic_video_format", 54: "stereoscopic_video_info",
        55: "transport_profile", 56: "HEVC_video", 63: "extension", 82: "stream_identifier"}  # fmt: skip
VIDEO_TYPES = (0x01, 0x02, 0x10, 0x1B, 0x20, 0x24, 0x42, 0xD1, 0xEA)  # of streams; MPEG-1 to H.265, AVS, VC-1
PARTS = {0xB9: "end", 0xBA: "pack", 0xBB: "system_header", 0xBC: "program_stream_map", 0xBD: "private_1",
         0xBE: "padding", 0xBF: "private_2", 0xFD: "extended", 0xFF: "directory"}  # fmt: skip
LISTS = (b"RIFF", b"LIST")
PACKET, SYNC = 188, 0x47


def stream_notes(file: BufferedReader, begin: bytes, name: str) -> list[str]:
    """Notes on fields that are not applied or not known; [] for another container. Raises InputError if refused."""
    file.seek(0)
    if begin[:4] == b"RIFF" and begin[8:12] == b"AVI ":
        return AVI.noted(avi_fields(file), name)
    if begin[:1] == b"G" or begin[4:5] == b"G":
        return TRANSPORT.noted(transport_fields(file.read(LOOKED_AT)), name)
    if begin[:4] == b"\0\0\1\xba":
        return PROGRAM.noted(program_fields(file.read(LOOKED_AT)), name)
    return []


def avi_fields(file: BufferedReader) -> Keys:
    """The chunks that describe the video stream, and those of the file."""
    found: Keys = {}
    end = file.seek(0, 2)
    for name, start, stop, inside in _chunks(file, 0, end):
        if "strl" not in inside:
            found[inside[-1] if "INFO" in inside else name] = True
        elif name == "strh":
            header = _read(file, start, stop)
            if header[:4] != b"vids":
                continue
            found["strh"] = True
            left, top, right, bottom = (int.from_bytes(header[k : k + 2], "little") for k in (48, 50, 52, 54))
            frame = (right - left, bottom - top)
        elif "strh" in found:
            found[name] = True
            if name == "strf" and len(data := _read(file, start, stop)) >= 12:
                size = int.from_bytes(data[4:8], "little"), abs(int.from_bytes(data[8:12], "little", signed=True))
                found["rcFrame"] = found.get("rcFrame") or (frame not in ((0, 0), size) and f"{frame[0]}x{frame[1]}")
    return found


def _chunks(file: BufferedReader, start: int, end: int, inside: tuple[str, ...] = ()) -> Iterator[Any]:
    """Name, first byte and end of the chunks between two places, with the lists that hold them."""
    for _ in range(MOST_CHUNKS):
        if start + 8 > end or len(inside) > 4:
            return
        head = _read(file, start, start + 12)
        name, stop = head[:4], start + 8 + int.from_bytes(head[4:8], "little")
        if name in LISTS:
            kind = head[8:12].decode("latin-1").strip()
            if kind != "movi":
                yield from _chunks(file, start + 12, min(stop, end), (*inside, kind))
        else:
            yield name.decode("latin-1").strip(), start + 8, min(stop, end), inside
        start = stop + stop % 2


def _read(file: BufferedReader, start: int, end: int) -> bytes:
    file.seek(start)
    return file.read(min(end - start, LARGEST_HEADER))


def transport_fields(data: bytes) -> Keys:
    """The descriptors of the video streams in the tables of the first programs, and whether packets are scrambled."""
    offset = 0 if data[:1] == b"G" else 4
    size = PACKET + offset
    tables: set[int] = set()
    videos: set[int] = set()
    found: Keys = {}
    for start in range(offset, len(data) - PACKET + 1, size):
        packet = data[start : start + PACKET]
        if packet[0] != SYNC:
            break
        number = (packet[1] & 0x1F) << 8 | packet[2]
        if number in videos and packet[3] >> 6:
            found["transport_scrambling_control"] = packet[3] >> 6
        section = table_in(packet) if number == 0 or number in tables else b""
        if number == 0:
            entries = [section[k : k + 4] for k in range(8, len(section) - 7, 4)]
            tables |= {(entry[2] & 0x1F) << 8 | entry[3] for entry in entries if entry[:2] != b"\0\0"}
        for kind, stream, descriptors in _streams(section) if number else ():
            if kind in VIDEO_TYPES:
                videos.add(stream)
                found["stream_type"] = kind
                found |= dict.fromkeys(descriptors, True)
    return found


def table_in(packet: bytes) -> bytes:
    """The table that begins in a packet, as far as the packet goes; empty without one."""
    if not packet[1] & 0x40:
        return b""
    start = 4 + (1 + packet[4] if packet[3] & 0x20 else 0)
    start += 1 + (packet[start] if start < len(packet) else 0)
    length = int.from_bytes(packet[start + 1 : start + 3]) & 0xFFF
    return packet[start : start + 3 + length]


def _streams(section: bytes) -> Iterator[tuple[int, int, list[str]]]:
    """Type, number and names of the descriptors of the streams in a table of a program."""
    if section[:1] != b"\2":
        return
    place, end = 12 + (int.from_bytes(section[10:12]) & 0xFFF), len(section) - 4
    while place + 5 <= end:
        kind, number = section[place], int.from_bytes(section[place + 1 : place + 3]) & 0x1FFF
        inner, names = place + 5, []
        place = inner + (int.from_bytes(section[place + 3 : place + 5]) & 0xFFF)
        while inner + 2 <= min(place, end):
            tag = section[inner]
            names.append(TAGS.get(tag, f"private_{tag}" if tag >= 64 else f"descriptor {tag}"))
            inner += 2 + section[inner + 1]
        yield kind, number, names


def program_fields(data: bytes) -> Keys:
    """The parts in the beginning of a program stream, and whether the video is scrambled."""
    found: Keys = {}
    start = 0
    while (start := data.find(b"\0\0\1", start)) >= 0 and start + 9 <= len(data):
        number = data[start + 3]
        start += 4
        if number < 0xB9:
            continue  # of the coded pictures
        video = 0xE0 <= number <= 0xEF
        name = "video" if video else "audio" if 0xC0 <= number <= 0xDF else PARTS.get(number, f"part {number:X}")
        found[name] = True
        flags = data[start + 2]
        if video and flags >> 6 == 2 and flags & 0x30:
            found["PES_scrambling_control"] = (flags & 0x30) >> 4
        if number > 0xBB:
            start += 2 + int.from_bytes(data[start : start + 2])  # of a part with a length
    return found
