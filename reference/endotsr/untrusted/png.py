"""Complete PNG files, reduced to the chunks that define their pixels.

A decoder fills missing pixels with grey, prints warnings on standard error, and parses text, colour profiles and
metadata that do not affect the pixels. Here the compressed pixels are unpacked once, to the size that the header
states, before the decoder sees them. All other chunks are removed.
"""

import struct
import zlib
from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.files import MOST_PIXELS
from endotsr.untrusted.first_bytes import FIRST_BYTES, true_name
from endotsr.untrusted.names import plain_line

(SIGNATURE,) = FIRST_BYTES["PNG"]
LARGEST_FILE = 1 << 28  # bytes: 256 MiB
MOST_EXTRA = 64  # bytes after the compressed pixels; some programs leave a few
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type
DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
TRANSPARENT = {0: 2, 2: 6}  # length of tRNS by colour type
PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))  # Adam7
LAST_FILTER = 4


class PngHeader(NamedTuple):
    """The chunk IHDR."""

    width: int
    height: int
    bits: int  # of a channel
    colour: int  # type
    interlaced: bool


def pixels_only(data: bytes, name: object) -> bytes:
    """The same picture with only the chunks IHDR, PLTE, tRNS, IDAT and IEND.

    data     content of a PNG file
    name     for messages

    Raises: InputError for a wrong signature, chunk length or checksum up to IEND, an invalid header, more than 2^26
            pixels, a necessary chunk that is missing, repeated or unknown, several pictures (APNG), or compressed
            pixels that do not match the header.
    """
    chunks = _chunks(data, name)
    header = _header(chunks, name)
    _refuse_moving(chunks, name)
    kept = [chunks[0]]
    palette = _palette(chunks, header, name)
    kept += palette
    kept += _transparency(chunks, header, len(palette[0][1]) // 3 if palette else 0)
    parts = [content for kind, content in chunks if kind == b"IDAT"]
    packed = b"".join(parts)
    extra = _check_pixels(packed, header, name)
    kept += [(b"IDAT", content) for content in (parts if not extra else [packed[:-extra]])]
    kept.append((b"IEND", b""))
    if kept == chunks:
        return data
    return data[:8] + b"".join(_chunk(kind, content) for kind, content in kept)


def _chunks(data: bytes, name: object) -> list[tuple[bytes, bytes]]:
    """Kind and content of every chunk up to IEND, each with its checksum verified."""
    if data[:8] != SIGNATURE:
        reason = "is empty" if not data else "does not start with the PNG signature"
        raise InputError(f"{name}: not a PNG file: it {reason}{true_name(data)}")
    found, position = [], 8
    while not found or found[-1][0] != b"IEND":
        if position + 12 > len(data):
            raise InputError(f"{name}: truncated PNG: the file ends after {len(data)} bytes, before its IEND chunk")
        (length,) = struct.unpack_from(">I", data, position)
        kind, end = data[position + 4 : position + 8], position + 12 + length
        said = plain_line(kind.decode("latin-1"))
        if end > len(data):
            raise InputError(f"{name}: truncated PNG: chunk {said} needs {end} bytes, the file has {len(data)}")
        if zlib.crc32(memoryview(data)[position + 4 : end - 4]) != int.from_bytes(data[end - 4 : end]):
            raise InputError(f"{name}: damaged PNG: wrong checksum in chunk {said}")
        found.append((kind, data[position + 8 : end - 4]))
        position = end
    return found


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def _header(chunks: list[tuple[bytes, bytes]], name: object) -> PngHeader:
    kind, content = chunks[0]
    if kind != b"IHDR" or len(content) != 13 or sum(kind == b"IHDR" for kind, _ in chunks) != 1:
        raise InputError(f"{name}: damaged PNG: its header is missing, repeated or of another length")
    foreign = [kind for kind, _ in chunks if kind[:1].isupper() and kind not in (b"IHDR", b"PLTE", b"IDAT", b"IEND")]
    if foreign:
        raise InputError(f"{name}: damaged PNG: unknown chunk {foreign[0].decode('latin-1')!r}")
    width, height, bits, colour, packing, filtering, interlace = struct.unpack(">IIBBBBB", content)
    if bits not in DEPTHS.get(colour, ()) or packing or filtering or interlace > 1:
        raise InputError(f"{name}: damaged PNG: its header states a kind of picture that does not exist")
    if not 0 < width * height <= MOST_PIXELS:
        raise InputError(f"{name}: {width}x{height} pixels; use 1 to {MOST_PIXELS} pixels")
    return PngHeader(width, height, bits, colour, interlace == 1)


def _refuse_moving(chunks: list[tuple[bytes, bytes]], name: object) -> None:
    """Refuse an animated PNG, of which a decoder returns the first picture only."""
    frames = next((int.from_bytes(content[:4], "big") for kind, content in chunks if kind == b"acTL"), 1)
    if frames > 1:
        raise InputError(f"{name}: holds {frames} pictures; use one picture per file")


def _palette(chunks: list[tuple[bytes, bytes]], header: PngHeader, name: object) -> list[tuple[bytes, bytes]]:
    """The palette chunk of a palette picture, as a list; [] for other colour types, whose palette is only suggested."""
    if header.colour != 3:
        return []
    found = [chunk for chunk in chunks if chunk[0] == b"PLTE"]
    entries = len(found[0][1]) // 3 if len(found) == 1 and len(found[0][1]) % 3 == 0 else 0
    if not 0 < entries <= 1 << header.bits:
        raise InputError(f"{name}: damaged PNG: its palette is missing, repeated or of another length")
    return found


def _transparency(chunks: list[tuple[bytes, bytes]], header: PngHeader, entries: int) -> list[tuple[bytes, bytes]]:
    """The chunk tRNS if its length fits the colour type."""
    found = [chunk for chunk in chunks if chunk[0] == b"tRNS"][:1]
    fits = [c for c in found if TRANSPARENT.get(header.colour) == len(c[1]) or 0 < len(c[1]) <= entries]
    return fits


def _check_pixels(packed: bytes, header: PngHeader, name: object) -> int:
    """Refuse compressed pixels that are damaged, too few or too many, or that use an unknown row filter.

    returns  number of bytes after the compressed pixels
    """
    rows = _rows(header)
    size = sum(count * (1 + stride) for count, stride in rows)
    unpacker = zlib.decompressobj()
    try:
        raw = unpacker.decompress(packed, size)
        more = unpacker.decompress(unpacker.unconsumed_tail, 1)
    except zlib.error as error:
        raise InputError(f"{name}: damaged PNG: its pixels cannot be unpacked: {error}") from None
    if len(raw) != size or more or not unpacker.eof or len(unpacker.unused_data) > MOST_EXTRA:
        raise InputError(f"{name}: damaged PNG: its pixels are not those of {header.width}x{header.height}")
    position, values = 0, np.frombuffer(raw, np.uint8)
    for count, stride in rows:
        filters = values[position : position + count * (1 + stride) : 1 + stride]
        if filters.max(initial=0) > LAST_FILTER:
            raise InputError(f"{name}: damaged PNG: a row of pixels uses an unknown filter")
        position += count * (1 + stride)
    return len(unpacker.unused_data)


def _rows(header: PngHeader) -> list[tuple[int, int]]:
    """Number of rows, and bytes per row without the filter byte, for every interlacing pass."""
    passes = PASSES if header.interlaced else ((0, 0, 1, 1),)
    bits, found = CHANNELS[header.colour] * header.bits, []
    for left, top, across, down in passes:
        columns, rows = -(-(header.width - left) // across), -(-(header.height - top) // down)
        if columns > 0 and rows > 0:
            found.append((rows, (columns * bits + 7) // 8))
    return found
