"""Rows of `inputs_tried.py` about pictures: formats, colour, names, and what they show."""

import os
import struct
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import (
    EXCHANGED,
    TWICE,
    changed_bytes,
    cut,
    exif,
    folder_of,
    named,
    pair,
    rewritten,
    twelve,
    with_files,
)
from input_rows import ALIKE, EXACT, refused, right, size, told
from made_videos import HEIGHT, WIDTH, picture, pictures, woven
from PIL import Image
from still_text import FRAMES, tissue, with_text
from stream_formats import bitmap

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png


def converted(ending: str, change=lambda opened: opened, **how):
    return lambda folder: rewritten(folder / "clip", change, ending, **how)


def resaved(ending: str, change=lambda opened: opened, **how):
    """The usual pictures as Pillow stores them."""
    return twelve(change=converted(ending, change, **how))


def transparent(columns: int):
    """The first columns of the pictures are transparent."""

    def changed(opened):
        alpha = np.full(opened.size[::-1], 255, np.uint8)
        alpha[:, :columns] = 0
        opened.putalpha(Image.fromarray(alpha))
        return opened

    return resaved("png", changed)


def with_fourth(change):
    """The usual pictures, of which the fourth file is changed."""
    return twelve(change=lambda folder: change(folder / "clip/0003.png"))


@builder
def shortened(folder: Path, ending: str) -> None:
    """The last twentieth of the fourth file is missing."""
    converted(ending)(folder)
    cut(0.95)(folder / f"clip/0003.{ending}")


def as_jpg(folder: Path) -> None:
    """Every second picture."""
    for file in sorted((folder / "clip").iterdir())[::2]:
        write_jpeg(file.with_suffix(".jpg"), read_png(file))
        file.unlink()


def chunk(kind: bytes, content: bytes):
    """Every picture with one more chunk of PNG."""

    def change(folder: Path) -> None:
        for file in (folder / "clip").iterdir():
            data = file.read_bytes()
            made = struct.pack(">I", len(content)) + kind + content
            file.write_bytes(data[:33] + made + struct.pack(">I", zlib.crc32(made[4:])) + data[33:])

    return twelve(change=change)


def oblong(folder: Path) -> None:
    converted("bmp")(folder)
    for file in (folder / "clip").iterdir():
        changed_bytes(lambda data: data[:38] + bitmap(38, "<ii", 2000, 1000)[38:46] + data[46:])(file)


def letterbox() -> list[np.ndarray]:
    found = np.array(pictures())
    found[:, :16] = found[:, -16:] = 0
    return list(found)


def broken(path: Path) -> None:
    """A link to nothing."""
    path.unlink()
    os.symlink(path.with_name("nothing"), path)


TISSUE_CAMERA = ("--camera", "250", "250", "128", "96")


def bars(shown: np.ndarray) -> np.ndarray:
    """The grey desktop of a console on both sides."""
    side = np.full((shown.shape[0], 60, 3), 90, np.uint8)
    return np.hstack([side, shown, side])


def with_inset(frame: np.ndarray, i: int) -> np.ndarray:
    """Another moment of the same tissue, small and brightened, in a corner."""
    found = frame.copy()
    found[:64, -80:] = 255 - tissue(FRAMES - 1 - i)[::3, ::3][:64, :80]
    return found


def green(shown: np.ndarray) -> np.ndarray:
    """The lower half as a decoder paints what it lost."""
    return np.concatenate([shown[: HEIGHT // 2], np.full_like(shown[HEIGHT // 2 :], (0, 135, 0))])


def of_tissue(change):
    """Moving tissue, changed by a function of the picture and its number."""
    return folder_of([change(tissue(i), i) for i in range(FRAMES)], camera=TISSUE_CAMERA)


def one_changed(change):
    """The usual pictures at half the speed, of which the sixth is changed."""
    shown = [picture(0.5 * i) for i in range(12)]
    return folder_of([*shown[:5], change(shown[5]), *shown[6:]])


BLENDED = [
    p.astype(np.uint8) for a, b in pairwise(tissue(i).astype(int) for i in range(FRAMES)) for p in (a, (a + b) // 2)
]
BLANK = Image.new("RGB", (WIDTH, HEIGHT))
CHROMATICITIES = (31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)  # of sRGB, times 100000
PICTURE_ROWS = [
    right("pictures, png", twelve(), EXACT),
    right("pictures, jpg", twelve(ending="jpg"), ALIKE),
    refused("pictures, jpg turned by EXIF", resaved("jpg", exif=exif(6)), "orientation 6"),
    refused("pictures, 16 bit", folder_of([p.astype(np.uint16) * 257 for p in pictures()]), "16-bit picture"),
    refused("pictures, transparent", transparent(40), "has transparent pixels"),
    right("pictures, with a full alpha channel", transparent(0), EXACT),
    right("pictures, with a palette", resaved("png", lambda opened: opened.quantize(256)), ALIKE),
    right("pictures, png and jpg mixed", twelve(change=as_jpg), ALIKE),
    right("pictures, CMYK jpg", resaved("jpg", lambda opened: opened.convert("CMYK"), quality=95), ALIKE),
    right("pictures, tif", resaved("tif"), EXACT),
    refused("pictures, tif, two in a file", resaved("tif", save_all=True, append_images=[BLANK]), "holds 2 pictures"),
    right("pictures, webp", resaved("webp", quality=90), ALIKE),
    right("pictures, webp without loss", resaved("webp", lossless=True), EXACT),
    refused("pictures, webp, moving", resaved("webp", save_all=True, append_images=[BLANK]), "holds 2 pictures"),
    right("pictures, bmp", resaved("bmp"), EXACT),
    told("pictures, colour profile of another space", resaved("png", icc_profile=b"Display P3" * 20),
        "a colour profile other than sRGB", EXACT),
    refused("pictures, moving PNG", resaved("png", save_all=True, append_images=[BLANK]), "holds 2 pictures"),
    told("pictures, PNG that states linear light", chunk(b"gAMA", struct.pack(">I", 100000)), "other than sRGB",
        EXACT),
    refused("pictures, JPEG without an ending of it", resaved("png", format="JPEG"),
        "does not start with the PNG signature"),
    refused("pictures, PNG turned by EXIF", chunk(b"eXIf", exif(6)[6:]), "orientation 6"),
    told("pictures, PNG of a stereo pair", chunk(b"sTER", b"\1"), "--stereo side_by_side"),
    refused("pictures, PNG of high dynamic range", chunk(b"cICP", bytes([9, 16, 0, 1])), "high dynamic range"),
    told("pictures, PNG with other primaries", chunk(b"cHRM", struct.pack(">8I", *CHROMATICITIES[:4], 21000, 71000,
        15000, 6000)), "a colour profile other than sRGB"),
    right("pictures, PNG with the primaries of sRGB", chunk(b"cHRM", struct.pack(">8I", *CHROMATICITIES)), EXACT),
    told("pictures, PNG with oblong pixels", chunk(b"pHYs", struct.pack(">IIB", 2, 1, 0)), "not square"),
    told("pictures, PNG with a chunk that is not known", chunk(b"neWc", b"1"), "unknown here: neWc"),
    told("pictures, several in a JPEG", resaved("jpg", format="MPO", save_all=True, append_images=[BLANK]),
        "MPF: further pictures"),
    told("pictures, Adobe RGB by EXIF", resaved("jpg", exif=exif(space=65535), quality=95), "profile other than sRGB"),
    told("pictures, bmp with oblong pixels", twelve(change=oblong), "the pixels are not square", EXACT),
    right("pictures, TIFF of CMYK", resaved("tif", lambda opened: opened.convert("CMYK")), ALIKE),
    refused("pictures, BigTIFF", resaved("tif", big_tiff=True), "not a TIFF file by its first bytes"),
    right("names beyond ASCII", named(lambda k: f"épreuve 画像 {k}.png"), EXACT),
    told("names with a gap in their numbers", named(lambda k: f"{k + 20 * (k > 5):04d}.png"),
        "frames count as evenly spaced in time", EXACT),
    refused("two names of one number", named(lambda k: "4.png" if k == 5 else f"{k:04d}.png"),
        "carry the same frame number"),
    right("files of the system beside pictures", twelve(change=with_files("clip/._0003.png", "clip/.DS_Store",
        "clip/Thumbs.db")), EXACT),
    right("names in capitals", named(lambda k: f"{k:04d}.PNG"), EXACT),
    right("names of copies", named(lambda k: f"IMG_{k:04d} (2).png"), EXACT),
    told("names of a counter that begins again", named(lambda k: f"IMG_{(9994 + k) % 10000:04d}.png"),
        "between IMG_0005.png and IMG_9994.png"),
    refused("pictures whose names begin with a dot", named(lambda k: f".{k:04d}.png"),
        "12 files whose name begins with a dot"),
    refused("names that are long", named(lambda k: "a" * 230 + f"{k:04d}.png"), "at most 200 bytes"),
    right("names with the number of frames", named(lambda k: f"f_{k + 1}of12.png"), size(WIDTH, HEIGHT)),
    told("pictures, interlaced", folder_of(woven()), "interlaced-pictures"),
    refused("pictures, grey", folder_of([p[..., 0] for p in pictures()]), "grey picture"),
    right("pictures, numbered without zeros", named(lambda k: f"{k}.png"), EXACT),
    *(refused(f"pictures, {kind} cut off", twelve(change=shortened(kind)), "damaged") for kind in ("tif", "webp",
        "bmp")),
    refused("pictures of two sizes", folder_of([*pictures(3), picture(3)[:80]]), "128x80 pixels, others 128x96"),
    refused("pictures, black", folder_of([picture(0) * 0] * 5), "5 of 5 frames are black"),
    refused("pictures, one under many names", folder_of([picture(0)] * 5), "all 5 frames are one picture"),
    told("pictures, negatives", folder_of([255 - p for p in pictures()]), "negative-pictures"),
    told("pictures, red and blue exchanged", folder_of([p[..., ::-1] for p in pictures()]), "blue-pictures"),
    told("pictures, every picture twice", folder_of(TWICE), "without the copies: --frames ::2"),
    told("pictures beside masks, depth, times and a calibration", pair(change=with_files("masks/0.png", "depth/0.png",
        "times.txt", "calib.yaml")), "not read: calib.yaml, depth/, masks/; see --masks, --depth, --calibration"),
    told("pictures, others of a kind that is not read", twelve(change=with_files(*(f"clip/{k:04d}.jp2" for k in
        range(12, 17)))), "not read: 5 files .jp2"),
    refused("pictures, one with zeros inside", with_fourth(changed_bytes(lambda data: data[:200] + bytes(len(data) -
        400) + data[-200:])), "0003.png"),
    refused("pictures, a name with a line break", with_fourth(lambda path: path.rename(path.with_name("00\n03.png"))),
        "use"),
    refused("pictures, heic", named(lambda k: f"{k:04d}.heic"), "12 files that end in .heic; convert"),
    told("pictures, letterbox", folder_of(letterbox()), "--crop 0 16 128 64 keeps the rest"),
    told("pictures of two cameras by their last number", named(lambda k: f"{k // 2:04d}_{k % 2}.png"),
        "if these are two cameras"),
    refused("pictures, names of a browser", named(lambda k: f"{k}.jfif"), "let their names end in .jpg"),
    refused("pictures, a broken link", with_fourth(broken), "0003.png: cannot be read"),
    told("pictures, another clip in a corner", of_tissue(with_inset), "in the upper right corner"),
    told("pictures, every second one blended", folder_of(BLENDED, camera=TISSUE_CAMERA),
        "every second picture is the mean of its neighbours"),
    told("pictures, text of a console", of_tissue(lambda shown, i: with_text(shown)), "burnt-in"),
    told("pictures, two recordings side by side", of_tissue(lambda shown, i: np.hstack([shown,
        255 - tissue(FRAMES - 1 - i)])), "a straight border crosses the pictures at column"),
    told("pictures, the grey desktop of a console beside them", of_tissue(lambda shown, i: bars(shown)),
        "a straight border crosses the pictures at column"),
    told("pictures, two of them exchanged", folder_of(EXCHANGED), "exchanged-frames"),
    told("pictures, one half of a frame lost", one_changed(green), "has exactly the colour 0 135 0"),
    told("pictures, a blue screen between", one_changed(lambda shown: np.full_like(shown, (0, 0, 255))),
        "does not resemble"),
    refused("pictures, one of them grey", one_changed(lambda shown: shown[..., 0]), "grey picture"),
]  # fmt: skip
