"""Picture files of a recording: PNG, JPEG, TIFF, WebP and BMP.

In: a path. Out: RGB or grey pixels as stored. Every reader refuses files that OpenCV would silently repair: a truncated
JPEG decodes to a picture whose lower part is grey. Sizes are checked before decoding.
"""

import importlib
import io
import logging
import struct
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.library import cv2_library
from endotsr.clips.opencv.other_kinds import scaled
from endotsr.clips.opencv.picture_marks import ORIENTATION, marks_of, picture_marks
from endotsr.clips.opencv.png import decode_png, decoded, opaque, write_encoded
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array
from endotsr.untrusted.files import MOST_PIXELS, read_bytes
from endotsr.untrusted.first_bytes import FIRST_BYTES, true_name
from endotsr.untrusted.names import choice, counted, plain_line
from endotsr.untrusted.png import LARGEST_FILE

JPEG_ENDINGS = (".jpg", ".jpeg")
TIFF_ENDINGS = (".tif", ".tiff")
PICTURE_ENDINGS = (".png", *JPEG_ENDINGS, *TIFF_ENDINGS, ".webp", ".bmp")  # of colour pictures and masks
JPEG_END = b"\xff\xd9"
KINDS = {  # extension -> file type
    **dict.fromkeys(JPEG_ENDINGS, "JPEG"), **dict.fromkeys(TIFF_ENDINGS, "TIFF"), ".webp": "WebP", ".bmp": "BMP"
}  # fmt: skip
PLUGINS = {"PNG": "PngImage", "JPEG": "JpegImage", "TIFF": "TiffImage", "WebP": "WebPImage", "BMP": "BmpImage"}
TIFF_WIDTH, TIFF_HEIGHT, TIFF_BITS, TIFF_PHOTOMETRIC, TIFF_CHANNELS, TIFF_FORMAT = 256, 257, 258, 262, 277, 339  # tags
FLOATING_POINT = 3  # of TIFF_FORMAT
ZERO_IS_WHITE = 0  # of TIFF_PHOTOMETRIC
GREY = ("1", "L")  # modes of Pillow
NOT_DECODED = ("LA", "La", "PA", "LAB")  # OpenCV drops their transparency or reads them as RGB


def read_picture(path: Path) -> Array:
    """Pixels of a PNG, JPEG, TIFF, WebP or BMP file: (H, W) grey or (H, W, 3) RGB, in the stored type.

    Raises:  InputError naming the file if it is missing, of another type, truncated, damaged, not opaque or rotated by
             its EXIF data, if it contains several pictures, or if it has more than 2^26 pixels.
    """
    ending = Path(path).suffix.lower()
    if ending == ".png":
        data = read_bytes(Path(path), LARGEST_FILE)
        pixels = decode_png(data, path)
        _check_turn(marks_of(data).get("Orientation") or 1, path)
        return pixels
    if ending not in KINDS:
        raise InputError(f"{path}: no picture by its name; use a name that ends in {choice(PICTURE_ENDINGS)}")
    data = read_bytes(Path(path), LARGEST_FILE)
    kind = _check_start_and_end(data, ending, path)
    pixels = _by_pillow(data, kind, path)
    if pixels is not None:
        return pixels
    return decoded(data, path, "cannot be decoded: the file is damaged, or this OpenCV lacks its format")


def read_points(path: Path) -> Array | None:
    """The three channels (H, W, 3) of a TIFF of floating-point numbers, such as x, y and z; None for another file.

    Raises:  InputError as `read_picture`.
    """
    if Path(path).suffix.lower() not in TIFF_ENDINGS:
        return None
    data = read_bytes(Path(path), LARGEST_FILE)
    kind = _check_start_and_end(data, Path(path).suffix.lower(), path)
    _plugin(kind)
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    try:
        tags = ImageFileDirectory_v2(data[:8])
        stream = io.BytesIO(data)
        stream.seek(tags.next)
        tags.load(stream)
        width, height = int(tags.get(TIFF_WIDTH, 0)), int(tags.get(TIFF_HEIGHT, 0))
        if tags.get(TIFF_CHANNELS, 1) != 3 or set(tags.get(TIFF_FORMAT, ())) != {FLOATING_POINT}:
            return None
    except Exception:  # Pillow passes on any error of its parser; the reader of pictures reports the fault
        return None
    _check_size((width, height), path)
    return decoded(data, path, "cannot be decoded: the file is damaged, or this OpenCV lacks its format")


def no_data(path: Path) -> float | None:
    """The number that means no value in a TIFF, as GDAL states it; None without one."""
    if Path(path).suffix.lower() not in TIFF_ENDINGS:
        return None
    try:
        return float(str(picture_marks(path).get("GDAL_NODATA", "")).strip("\0 "))
    except ValueError:
        return None


def _by_pillow(data: bytes, kind: str, path: Path) -> Array | None:
    """Pixels. For a TIFF, only the header is checked and None is returned.

    Pillow returns the same pixels as OpenCV. OpenCV prints warnings about a damaged JPEG, reads the first of several
    pictures, and reads the unused fourth byte of a BMP as transparency. For TIFF, Pillow truncates 16 bits and its
    library prints warnings.
    """
    try:
        if kind == "WebP":
            _check_size(_webp_size(data), path)  # Pillow allocates the picture when it opens the file
        with _plugin(kind)(io.BytesIO(data)) as picture:
            _check_size(picture.size, path)
            _check_one_upright(picture, path)
            if kind == "TIFF":
                if picture.mode in NOT_DECODED:
                    raise InputError(f"{path}: a TIFF of the mode {picture.mode}; use grey, palette, RGB, CMYK")
                _check_white(picture, path)
                return None
            if picture.mode in GREY:
                return np.array(picture.convert("L"))
            alpha = "A" in picture.getbands() or "transparency" in picture.info
            return np.ascontiguousarray(opaque(np.array(picture.convert("RGBA" if alpha else "RGB")), path))
    except InputError:
        raise
    except Exception as error:  # Pillow passes on any error of its metadata parsers
        if "unknown pixel mode" in str(error) and kind == "TIFF":
            raise InputError(
                f"{path}: a TIFF of a kind that is not read, such as colours of floating-point numbers, or numbers of"
                " 16 or 64 bits with a point; use whole numbers of 8 or 16 bits, or one channel of floating-point"
                f" numbers of 32 bits; of frames, {scaled()}"
            ) from None
        raise InputError(f"{path}: damaged {kind}: {plain_line(str(error))}") from None


@cache
def _plugin(kind: str) -> Any:
    """Pillow's class for a file type, without the limit of `Image.open`, which prints a warning."""
    name = PLUGINS[kind]
    warnings.filterwarnings("ignore", module=r"PIL\.")  # about metadata, without a file name
    logging.getLogger("PIL").addHandler(logging.NullHandler())  # it would print errors, without a file name either
    return getattr(importlib.import_module(f"PIL.{name}Plugin"), f"{name}File")


def _check_white(picture: Any, path: Path) -> None:
    """Refuse a TIFF of more than 8 bits in which 0 is white: OpenCV inverts those of 8 bits and fewer alone."""
    bits = picture.tag_v2.get(TIFF_BITS, (1,))
    if picture.tag_v2.get(TIFF_PHOTOMETRIC) == ZERO_IS_WHITE and max(bits) > 8:
        raise InputError(
            f"{path}: states that 0 is white (PhotometricInterpretation 0): its numbers are inverted where it is shown;"
            " store 0 as black, as most programs do"
        )


def _check_one_upright(picture: Any, path: Path) -> None:
    _check_turn(picture.getexif().get(ORIENTATION, 1), path)
    if getattr(picture, "n_frames", 1) != 1:
        raise InputError(f"{path}: holds {picture.n_frames} pictures; use one picture per file")


def _check_turn(turn: int, path: Path) -> None:
    if turn not in (0, 1):
        raise InputError(
            f"{path}: its EXIF data rotate the picture (orientation {turn}), but a calibration may not;"
            " use pictures stored in the orientation in which they are shown"
        )


def _check_size(size: tuple[int, int], path: Path) -> None:
    if not 0 < size[0] * size[1] <= MOST_PIXELS:
        raise InputError(f"{path}: {size[0]}x{size[1]} pixels; use at most {MOST_PIXELS}")


def _webp_size(data: bytes) -> tuple[int, int]:
    """Width and height in the header of a WebP file, in any of its three forms."""
    form, start = data[12:16], data[20:30].ljust(10, b"\0")
    if form == b"VP8X":  # 24 bits each, less one
        return 1 + int.from_bytes(start[4:7], "little"), 1 + int.from_bytes(start[7:10], "little")
    if form == b"VP8L":  # 14 bits each, less one
        (packed,) = struct.unpack_from("<I", start, 1)
        return 1 + (packed & 0x3FFF), 1 + (packed >> 14 & 0x3FFF)
    width, height = struct.unpack_from("<HH", start, 6)
    return width & 0x3FFF, height & 0x3FFF


def _check_start_and_end(data: bytes, ending: str, path: Path) -> str:
    """The file type by its extension, confirmed by its first bytes."""
    kind = KINDS[ending]
    if not data:
        raise InputError(f"{path}: the file is empty")
    if not data.startswith(FIRST_BYTES[kind]):
        raise InputError(f"{path}: not a {kind} file by its first bytes{true_name(data)}")
    if kind == "JPEG" and JPEG_END not in data[-64:]:  # some cameras append a few bytes
        raise InputError(
            f"{path}: truncated JPEG: the file ends after {counted(len(data), 'byte')}, without its end marker"
        )
    return kind


def write_jpeg(path: Path, pixels: Array, quality: int = 95) -> None:
    """Write (H, W, 3) RGB uint8 as JPEG. Raises InputError if the file cannot be written."""
    write_encoded(path, pixels, ".jpeg", (cv2_library().IMWRITE_JPEG_QUALITY, quality))
