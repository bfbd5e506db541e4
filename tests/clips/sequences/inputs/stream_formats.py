"""Small AVI and MPEG files and BMP pictures, and a change of each of their fields that is used."""

import struct
import tempfile
from functools import cache
from pathlib import Path

from field_formats import Format, Keys
from file_formats import saved, whole
from made_videos import pictures, write
from video_formats import told as with_count

from endotsr.clips.formats import picture_fields, stream_marks

KINDS = {"avi": ("rawvideo", "bgr24"), "ts": ("libx264", "yuv420p"), "vob": ("mpeg2video", "yuv420p")}
TAG = {name: number for number, name in stream_marks.TAGS.items()}


def told(folder: Path) -> object:
    """What the video says, and its notes."""
    found, count, notes = with_count(folder)
    return (found, count), notes


@cache
def made(kind: str) -> bytes:
    """A video of four pictures; the AVI states pixels of 3:2."""
    codec, layout = KINDS[kind]
    with tempfile.TemporaryDirectory() as scratch:
        data = write(Path(scratch) / f"a.{kind}", pictures(4), codec=codec, layout=layout).read_bytes()
    if kind != "avi":
        return data
    place = data.index(b"JUNK", data.index(b"strl"))
    aspect = struct.pack("<5I2H2I", 0, 0, 0, 0, 0, 96, 3 * 64, 128, 96)
    return data[:place] + b"vprp" + data[place + 4 : place + 8] + aspect + data[place + 8 + len(aspect) :]


def write_avi(folder: Path, keys: Keys) -> None:
    """Chunks that are None have no meaning; rcFrame is the rectangle in strh."""
    data = bytearray(made("avi"))
    for name, value in keys.items():
        if value is None:
            data[(place := data.index(name.encode())) : place + 4] = b"JUNK"
        elif name == "rcFrame":
            place = data.index(b"strh") + 8 + 48
            data[place : place + 8] = struct.pack("<4h", *value)
    (folder / "a.avi").write_bytes(data)


def checksum(data: bytes) -> bytes:
    """CRC-32 of MPEG."""
    found = 0xFFFFFFFF
    for byte in data:
        found ^= byte << 24
        for _ in range(8):
            found = (found << 1) ^ (0x104C11DB7 if found & 0x80000000 else 0)
    return struct.pack(">I", found & 0xFFFFFFFF)


def write_transport(folder: Path, keys: Keys) -> None:
    """The stream with another type, with scrambled packets, or with an empty descriptor of a name."""
    data = bytearray(made("ts"))
    for start in range(0, len(data), 188):
        packet = bytes(data[start : start + 188])
        section = stream_marks.table_in(packet)
        if section[:1] == b"\2":
            place = packet.index(section)
            begin = 12 + (int.from_bytes(section[10:12]) & 0xFFF)
            more = b"".join(bytes([TAG[name], 1, 0]) for name in keys if name in TAG)
            kind = keys.get("stream_type", section[begin])
            stream = bytes([kind]) + section[begin + 1 : begin + 3] + struct.pack(">H", 0xF000 | len(more)) + more
            body = section[3:begin] + stream
            head = section[:1] + struct.pack(">H", 0xB000 | len(body) + 4)
            table = head + body + checksum(head + body)
            data[start : start + 188] = (packet[:place] + table).ljust(188, b"\xff")
        elif "transport_scrambling_control" in keys and (packet[1] & 0x1F, packet[2]) == (1, 0):
            data[start + 3] |= keys["transport_scrambling_control"] << 6
    (folder / "a.ts").write_bytes(data)


def write_program(folder: Path, keys: Keys) -> None:
    """The video has the number of sound without "video"; its packets are scrambled with the mark."""
    data = bytearray(made("vob"))
    place = 0
    while (place := data.find(b"\0\0\1\xe0", place)) >= 0:
        data[place + 6] |= keys.get("PES_scrambling_control", 0) << 4
        if keys["video"] is None:
            data[place + 3] = 0xC0
        place += 4
    (folder / "a.mpg").write_bytes(data)


def bitmap(place: int = 0, form: str = "", *values: object, longer: bool = False) -> bytes:
    """A BMP with other values at a place; the longer header also has a colour space."""
    data = bytearray(saved("BMP"))
    if longer:
        begin = int.from_bytes(data[10:14], "little")
        data[14:18], data[10:14] = struct.pack("<I", 108), struct.pack("<I", begin + 68)
        data[begin:begin] = struct.pack("<4I", 0, 0, 0, 0) + b"BGRs" + bytes(48)
    if form:
        struct.pack_into(form, data, place, *values)
    return bytes(data)


BMP_CHANGES = {"bfType": bitmap(0, "2s", b"BA"), "bfOffBits": bitmap(10, "<I", 60), "biSize": bitmap(14, "<I", 12),
               "biWidth": bitmap(18, "<i", 31), "biHeight": bitmap(22, "<i", -24), "biBitCount": bitmap(28, "<H", 8),
               "biCompression": bitmap(30, "<I", 1)}  # fmt: skip
AVI_PARTS = dict.fromkeys(("strh", "strf", "vprp"), True)
STREAMS = {
    "avi": Format(stream_marks.AVI, AVI_PARTS, write_avi, told, dict.fromkeys(AVI_PARTS), {},
                  {"rcFrame": (0, 0, 64, 48)}),
    "ts": Format(stream_marks.TRANSPORT, {"stream_type": 0x1B}, write_transport, told, {"stream_type": 0x02},
                 {"transport_scrambling_control": 2} | dict.fromkeys(("MVC_extension", "MVC_operation_point",
                  "stereoscopic_video_format", "stereoscopic_video_info"), 1),
                 {"CA": 1, "auxiliary_video_stream": 1, "video_window": 1}),
    "mpg": Format(stream_marks.PROGRAM, {"video": True}, write_program, told, {"video": None},
                  {"PES_scrambling_control": 1}),
    "bmp": whole(picture_fields.BMP, "bmp", bitmap(), BMP_CHANGES, {}, {
        "biXPelsPerMeter": bitmap(38, "<ii", 2000, 1000), "bV4CSType": bitmap(70, "4s", b"KNIL", longer=True)}),
}  # fmt: skip
BY_PILLOW = {"biClrUsed"}
