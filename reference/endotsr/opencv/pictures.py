"""Picture files of any kind that a recording may hold: PNG, JPEG, TIFF, and OpenEXR where OpenCV has it.

Comes in: a path; goes out: RGB or grey pixels as stored. Every reader refuses a file that OpenCV would repair in
silence: a JPEG that was cut off decodes to a picture whose lower part is grey.
"""

import io
from pathlib import Path

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import Array
from endotsr.opencv import decoded, read_png
from endotsr.opencv.library import cv2_library
from endotsr.untrusted.files import MOST_PIXELS, read_bytes
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.png import LARGEST_FILE

JPEG_ENDINGS = (".jpg", ".jpeg")
TIFF_ENDINGS = (".tif", ".tiff")
EXR_ENDINGS = (".exr",)
PICTURE_ENDINGS = (".png", *JPEG_ENDINGS)  # of colour pictures and masks
JPEG_START, JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"
ORIENTATION = 0x0112  # EXIF tag: 1 = shown as it is stored
TIFF_STARTS = (b"II*\0", b"MM\0*")
EXR_START = b"v/1\x01"


def read_picture(path: Path) -> Array:
    """Pixels of a PNG, JPEG, TIFF or EXR file: (H, W) grey or (H, W, 3) RGB, in the stored type.

    Raises:  InputError naming the file if it is missing, of another kind, truncated or damaged.
    """
    ending = Path(path).suffix.lower()
    if ending == ".png":
        return read_png(path)
    if ending not in JPEG_ENDINGS + TIFF_ENDINGS + EXR_ENDINGS:
        raise InputError(f"{path}: no picture by its name; allowed: .png, .jpg, .jpeg, .tif, .tiff, .exr")
    data = read_bytes(Path(path), LARGEST_FILE)
    _check_start_and_end(data, ending, path)
    if ending in JPEG_ENDINGS:
        return _jpeg(data, path)
    return decoded(data, path, "cannot be decoded: the file is damaged, or this OpenCV lacks its format")


def _jpeg(data: bytes, path: Path) -> Array:
    """Pixels of a JPEG file. Pillow returns those of OpenCV, which prints complaints about a damaged file itself."""
    from PIL.JpegImagePlugin import JpegImageFile  # without the limit of `Image.open`, which prints a warning

    try:
        with JpegImageFile(io.BytesIO(data)) as picture:
            turn = picture.getexif().get(ORIENTATION, 1)
            if turn not in (0, 1):
                raise InputError(
                    f"{path}: its EXIF data turn the picture (orientation {turn}), which a calibration may not know;"
                    " allowed: pictures that are stored as they are shown"
                )
            if picture.width * picture.height > MOST_PIXELS:
                raise InputError(f"{path}: {picture.width}x{picture.height} pixels; allowed: at most {MOST_PIXELS}")
            return np.array(picture if picture.mode == "L" else picture.convert("RGB"))
    except InputError:
        raise
    except Exception as error:  # Pillow raises whatever its parsers of metadata meet
        raise InputError(f"{path}: damaged JPEG: {plain_line(str(error))}") from None


def _check_start_and_end(data: bytes, ending: str, path: Path) -> None:
    if not data:
        raise InputError(f"{path}: the file is empty")
    if ending in JPEG_ENDINGS:
        if not data.startswith(JPEG_START):
            raise InputError(f"{path}: not a JPEG file: it does not start with the JPEG signature")
        if JPEG_END not in data[-64:]:  # some cameras append a few bytes
            raise InputError(f"{path}: truncated JPEG: the file ends after {len(data)} bytes, without its end marker")
    starts = TIFF_STARTS if ending in TIFF_ENDINGS else (EXR_START,)
    if ending not in JPEG_ENDINGS and not data.startswith(starts):
        raise InputError(f"{path}: not a {'TIFF' if ending in TIFF_ENDINGS else 'EXR'} file by its first bytes")


def write_jpeg(path: Path, pixels: Array, quality: int = 95) -> None:
    """Write (H, W, 3) RGB uint8 as JPEG. Raises InputError if the file cannot be written."""
    cv2 = cv2_library()
    done, encoded = cv2.imencode(".jpg", np.ascontiguousarray(pixels[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise InputError(f"{path}: the picture cannot be encoded as JPEG")
    try:
        Path(path).write_bytes(encoded.tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
