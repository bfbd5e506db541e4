"""PNG files: every pixel is there or the file is refused, and no decoder writes on standard error."""

import struct
import zlib

import numpy as np
import pytest

from endotsr.clips.opencv.png import decode_png, read_png, write_png
from endotsr.errors import InputError
from endotsr.untrusted.files import MOST_PIXELS
from endotsr.untrusted.png import pixels_only

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def chunk(kind, content=b""):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def header(width=4, height=3, bits=8, colour=2, packing=0, filtering=0, interlace=0):
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, packing, filtering, interlace))


def pixels(rows=3, stride=12, first=0):
    return zlib.compress(b"".join(bytes([first, *range(stride)]) for _ in range(rows)))


def png(*chunks):
    return SIGNATURE + b"".join(chunks) + chunk(b"IEND")


WHOLE = png(header(), chunk(b"IDAT", pixels()))


def test_the_whole_picture_is_read():
    assert decode_png(WHOLE, "a.png").tolist() == [[[3 * x, 3 * x + 1, 3 * x + 2] for x in range(4)]] * 3


BAD = {
    "no header": png(chunk(b"IDAT", pixels())),
    "two headers": png(header(), header(), chunk(b"IDAT", pixels())),
    "short header": png(chunk(b"IHDR", bytes(12)), chunk(b"IDAT", pixels())),
    "no columns": png(header(width=0), chunk(b"IDAT", pixels())),
    "too many pixels": png(header(width=1 << 14, height=(MOST_PIXELS >> 14) + 1), chunk(b"IDAT", pixels())),
    "largest header": png(header(width=0xFFFFFFFF, height=0xFFFFFFFF), chunk(b"IDAT", pixels())),
    "unknown colour type": png(header(colour=5), chunk(b"IDAT", pixels())),
    "unknown depth": png(header(bits=3), chunk(b"IDAT", pixels())),
    "unknown packing": png(header(packing=1), chunk(b"IDAT", pixels())),
    "unknown interlacing": png(header(interlace=2), chunk(b"IDAT", pixels())),
    "no pixels": png(header()),
    "too few pixels": png(header(), chunk(b"IDAT", pixels(rows=2))),
    "too many rows": png(header(), chunk(b"IDAT", pixels(rows=4))),
    "cut pixels": png(header(), chunk(b"IDAT", pixels()[:-6])),
    "damaged pixels": png(header(), chunk(b"IDAT", b"x\x9c" + bytes(20))),
    "unknown filter": png(header(), chunk(b"IDAT", pixels(first=5))),
    "bomb": png(header(), chunk(b"IDAT", zlib.compress(bytes(10_000_000)))),
    "no palette": png(header(colour=3), chunk(b"IDAT", pixels(stride=4))),
    "long palette": png(header(colour=3, bits=1), chunk(b"PLTE", bytes(9)), chunk(b"IDAT", pixels(stride=1))),
    "unknown critical chunk": png(header(), chunk(b"EVIL"), chunk(b"IDAT", pixels())),
}


@pytest.mark.parametrize("name", BAD)
def test_a_picture_that_is_not_whole_is_refused_silently(name, capfd):
    with pytest.raises(InputError, match=r"^a\.png: (damaged PNG|.* pixels; use)"):
        decode_png(BAD[name], "a.png")
    assert capfd.readouterr() == ("", "")


NOISY = [
    chunk(b"iCCP", b"x\0\0damaged"),
    chunk(b"gAMA", b"\0\0\0\0"),
    chunk(b"tEXt", b"no separator"),
    chunk(b"zTXt", b"key\0\0" + zlib.compress(bytes(1_000_000))),
    chunk(b"tIME", b"?"),
    chunk(b"tRNS", bytes(7)),
    chunk(b"cHRM", bytes(3)),
]


@pytest.mark.parametrize("noise", NOISY, ids=[n[4:8].decode() for n in NOISY])
def test_chunks_that_no_pixel_needs_are_not_decoded(noise, capfd):
    noisy = png(header(), noise, chunk(b"IDAT", pixels()))
    assert (decode_png(noisy, "a.png") == decode_png(WHOLE, "a.png")).all()
    assert pixels_only(noisy, "a.png") == WHOLE
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_written_pictures_pass_unchanged(shape, dtype, tmp_path):
    values = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    write_png(tmp_path / "a.png", values)
    data = (tmp_path / "a.png").read_bytes()
    assert pixels_only(data, "a.png") is data or len(pixels_only(data, "a.png")) < len(data)
    back = read_png(tmp_path / "a.png")
    assert back.dtype == dtype and back.flags.c_contiguous and np.array_equal(back, values)


@pytest.mark.parametrize("parts", [1, 3])
def test_bytes_after_the_pixels_are_left_out(parts, capfd):
    packed = pixels() + b"left over"
    cut = [packed[k * len(packed) // parts : (k + 1) * len(packed) // parts] for k in range(parts)]
    assert (decode_png(png(header(), *(chunk(b"IDAT", p) for p in cut)), "a.png") == decode_png(WHOLE, "a.png")).all()
    with pytest.raises(InputError, match="its pixels are not those of"):
        decode_png(png(header(), chunk(b"IDAT", pixels() + bytes(100))), "a.png")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("end", [b"", b"content"])
def test_the_end_is_written_anew(end, capfd):
    odd = SIGNATURE + header() + chunk(b"IDAT", pixels()) + chunk(b"IEND", end)
    assert pixels_only(odd, "a.png") == WHOLE and decode_png(odd, "a.png").shape == (3, 4, 3)
    assert capfd.readouterr() == ("", "")


def interlaced(width, height):
    """An interlaced grey picture of zeros."""
    passes = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
    rows = b""
    for left, top, across, down in passes:
        columns = len(range(left, width, across))
        rows += b"".join(bytes(1 + columns) for _ in range(top, height, down) if columns)
    return png(header(width, height, colour=0, interlace=1), chunk(b"IDAT", zlib.compress(rows)))


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (8, 8), (13, 5), (1, 9)])
def test_interlaced_pictures_are_counted_right(size, capfd):
    assert decode_png(interlaced(*size), "a.png").shape == size[::-1]
    assert capfd.readouterr() == ("", "")
