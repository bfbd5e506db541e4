"""Rows of `inputs_tried.py` about pictures: formats, colour, names, and what they show."""

import os
import shutil
import struct
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import (
    TWICE,
    Row,
    close,
    cut,
    exchanged_frames,
    exif,
    folder_of,
    named,
    pair,
    prepare,
    rewritten,
    size,
    slow,
    with_files,
)
from made_videos import HEIGHT, WIDTH, files, picture, pictures, woven
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from still_text import FRAMES, tissue, with_text
from stream_formats import bitmap

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png, write_png


def converted(ending: str, change=lambda opened: opened, **how):
    return lambda folder: rewritten(folder / "clip", change, ending, **how)


def transparent(columns: int):
    """The first columns of the pictures are transparent."""

    def changed(opened):
        alpha = np.full(opened.size[::-1], 255, np.uint8)
        alpha[:, :columns] = 0
        opened.putalpha(Image.fromarray(alpha))
        return opened

    return converted("png", changed)


def blank():
    return Image.new("RGB", (WIDTH, HEIGHT))


@builder
def shortened(folder: Path, ending: str) -> None:
    """The last twentieth of the fourth file is missing."""
    converted(ending)(folder)
    cut(0.95)(folder / f"clip/0003.{ending}")


def every_second_jpg(folder: Path) -> None:
    for file in sorted((folder / "clip").iterdir())[::2]:
        pixels = read_png(file)
        file.unlink()
        write_jpeg(file.with_suffix(".jpg"), pixels)


def linear() -> PngInfo:
    chunks = PngInfo()
    chunks.add(b"gAMA", struct.pack(">I", 100000))
    return chunks


def chunk(kind: bytes, content: bytes):
    """Every picture with one more chunk of PNG."""

    def change(folder: Path) -> None:
        for file in (folder / "clip").iterdir():
            data = file.read_bytes()
            made = struct.pack(">I", len(content)) + kind + content
            file.write_bytes(data[:33] + made + struct.pack(">I", zlib.crc32(made[4:])) + data[33:])

    return folder_of(pictures(4), change=change)


def of_another_kind(folder: Path) -> None:
    for k in range(5):
        (folder / f"clip/{12 + k:04d}.jp2").write_bytes(b"jp2")


def oblong(folder: Path) -> None:
    converted("bmp")(folder)
    for file in (folder / "clip").iterdir():
        data = bytearray(file.read_bytes())
        data[38:46] = bitmap(38, "<ii", 2000, 1000)[38:46]
        file.write_bytes(data)


def one_file(change):
    """The fourth picture is changed."""
    return folder_of(pictures(), change=lambda folder: change(folder / "clip/0003.png"))


def zeroed(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[:200] + bytes(len(data) - 400) + data[-200:])


def looped(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def quotes(folder: Path) -> list[str]:
    """A folder whose name has spaces, quotes and a dollar sign."""
    files(folder, "my 'clip' \"1\" $HOME", pictures())
    return prepare("my 'clip' \"1\" $HOME")(folder)


def letterbox(count=12):
    found = pictures(count)
    for shown in found:
        shown[:16], shown[-16:] = 0, 0
    return found


def links(folder: Path) -> None:
    """The pictures are links to files of another folder."""
    os.rename(folder / "clip", folder / "real")
    (folder / "clip").mkdir()
    for file in (folder / "real").iterdir():
        os.symlink(file, folder / "clip" / file.name)


def broken_link(folder: Path) -> None:
    (folder / "clip/0003.png").unlink()
    os.symlink(folder / "nothing.png", folder / "clip/0003.png")


def pil(ending: str, change=lambda opened: opened, **how):
    return folder_of(pictures(), change=converted(ending, change, **how))


TISSUE_CAMERA = ("--camera", "250", "250", "128", "96")


@builder
def of_tissue(folder: Path, change, *words: str) -> list[str]:
    """Pictures of moving tissue, changed."""
    files(folder, "clip", [change(tissue(i), i) for i in range(FRAMES)])
    return prepare("clip", *words, camera=TISSUE_CAMERA)(folder)


def bars(shown: np.ndarray) -> np.ndarray:
    """The grey desktop of a console on both sides."""
    side = np.full((shown.shape[0], 60, 3), 90, np.uint8)
    return np.hstack([side, shown, side])


def with_inset(frame: np.ndarray, i: int) -> np.ndarray:
    """Another moment of the same tissue, small and brightened, in a corner."""
    found = frame.copy()
    found[:64, -80:] = 255 - tissue(FRAMES - 1 - i)[::3, ::3][:64, :80]
    return found


def blended(folder: Path) -> list[str]:
    shown = [tissue(i).astype(int) for i in range(FRAMES)]
    files(folder, "clip", [p.astype(np.uint8) for a, b in pairwise(shown) for p in (a, (a + b) // 2)])
    return prepare("clip", camera=TISSUE_CAMERA)(folder)


def one_changed(change, number: int = 5):
    """Frame 5 as another picture."""

    def done(folder: Path) -> None:
        file = folder / f"clip/{number:04d}.png"
        write_png(file, change(read_png(file)))

    return folder_of([picture(0.5 * i) for i in range(12)], change=done)


def green(shown: np.ndarray) -> np.ndarray:
    """The lower half as a decoder paints what it lost."""
    shown = shown.copy()
    shown[HEIGHT // 2 :] = (0, 135, 0)
    return shown


PICTURE_ROWS = [
    Row("pictures, png", folder_of(pictures()), "right", "", close(pictures(), 0.01)),
    Row("pictures, jpg", folder_of(pictures(), ending="jpg"), "right", "", close(pictures())),
    Row("pictures, jpg turned by EXIF", folder_of(pictures(), change=converted("jpg", exif=exif(6))), "refused",
        "orientation 6"),
    Row("pictures, 16 bit", folder_of([p.astype(np.uint16) * 257 for p in pictures()]), "refused", "16-bit picture"),
    Row("pictures, transparent", folder_of(pictures(), change=transparent(40)), "refused", "has transparent pixels"),
    Row("pictures, with a full alpha channel", folder_of(pictures(), change=transparent(0)), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, with a palette", folder_of(pictures(), change=converted("png", lambda opened: opened.quantize(256))),
        "right", "", close(pictures())),
    Row("pictures, png and jpg mixed", folder_of(pictures(), change=every_second_jpg), "right", "", close(pictures())),
    Row("pictures, CMYK jpg", folder_of(pictures(), change=converted("jpg", lambda opened: opened.convert("CMYK"),
        quality=95)), "right", "", close(pictures())),
    Row("pictures, tif", folder_of(pictures(), change=converted("tif")), "right", "", close(pictures(), 0.01)),
    Row("pictures, tif, LZW", folder_of(pictures(), change=converted("tif", compression="tiff_lzw")), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, tif, two in a file", folder_of(pictures(), change=converted("tif", save_all=True,
        append_images=[blank()])), "refused", "holds 2 pictures"),
    Row("pictures, webp", folder_of(pictures(), change=converted("webp", quality=90)), "right", "", close(pictures())),
    Row("pictures, webp without loss", folder_of(pictures(), change=converted("webp", lossless=True)), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, webp, moving", folder_of(pictures(), change=converted("webp", save_all=True,
        append_images=[blank()])), "refused", "holds 2 pictures"),
    Row("pictures, bmp", folder_of(pictures(), change=converted("bmp")), "right", "", close(pictures(), 0.01)),
    Row("pictures, colour profile of another space", folder_of(pictures(), change=converted("png",
        icc_profile=b"Display P3" * 20)), "told", "a colour profile other than sRGB", close(pictures(), 0.01)),
    Row("pictures, moving PNG", folder_of(pictures(), change=converted("png", save_all=True, append_images=[blank()])),
        "refused", "holds 2 pictures"),
    Row("pictures, PNG that states linear light", folder_of(pictures(), change=converted("png", pnginfo=linear())),
        "told", "other than sRGB", close(pictures(), 0.01)),
    Row("pictures, JPEG without an ending of it", folder_of(pictures(), change=converted("png", format="JPEG")),
        "refused", "does not start with the PNG signature"),
    Row("pictures, PNG turned by EXIF", chunk(b"eXIf", exif(6)[6:]), "refused", "orientation 6"),
    Row("pictures, PNG of a stereo pair", chunk(b"sTER", b"\1"), "told", "--stereo side_by_side"),
    Row("pictures, PNG of high dynamic range", chunk(b"cICP", bytes([9, 16, 0, 1])), "refused", "high dynamic range"),
    Row("pictures, PNG with other primaries", chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 21000,
        71000, 15000, 6000)), "told", "a colour profile other than sRGB"),
    Row("pictures, PNG with the primaries of sRGB", chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000,
        60000, 15000, 6000)), "right", "", close(pictures(4), 0.01)),
    Row("pictures, PNG with oblong pixels", chunk(b"pHYs", struct.pack(">IIB", 2, 1, 0)), "told", "not square"),
    Row("pictures, PNG with a chunk that is not known", chunk(b"neWc", b"1"), "told", "unknown here: neWc"),
    Row("pictures, several in a JPEG", folder_of(pictures(4), change=converted("jpg", format="MPO", save_all=True,
        append_images=[blank()])), "told", "MPF: further pictures"),
    Row("pictures, Adobe RGB by EXIF", folder_of(pictures(4), change=converted("jpg", exif=exif(space=65535),
        quality=95)), "told", "profile other than sRGB"),
    Row("pictures, bmp with oblong pixels", folder_of(pictures(4), change=oblong), "told", "the pixels are not square",
        close(pictures(4), 0.01)),
    Row("pictures, TIFF of CMYK", pil("tif", lambda opened: opened.convert("CMYK")), "right", "", close(pictures())),
    Row("pictures, TIFF of YCbCr", pil("tif", lambda opened: opened.convert("YCbCr")), "right", "", close(pictures())),
    Row("pictures, TIFF with JPEG", pil("tif", compression="jpeg", quality=95), "right", "", close(pictures())),
    Row("pictures, progressive jpg", pil("jpg", progressive=True, quality=95), "right", "", close(pictures())),
    Row("pictures, jpg stored as RGB", pil("jpg", keep_rgb=True, quality=95), "right", "", close(pictures())),
    Row("pictures, BigTIFF", pil("tif", big_tiff=True), "refused", "not a TIFF file by its first bytes"),
    Row("names beyond ASCII", named(lambda k: f"épreuve 画像 {k}.png"), "right", "", close(pictures(), 0.01)),
    Row("names with a gap in their numbers", named(lambda k: f"{k + 20 * (k > 5):04d}.png"), "told",
        "frames count as evenly spaced in time", close(pictures(), 0.01)),
    Row("two names of one number", named(lambda k: "4.png" if k == 5 else f"{k:04d}.png"), "refused",
        "carry the same frame number"),
    Row("files of the system beside pictures", folder_of(pictures(), change=with_files("clip/._0003.png",
        "clip/.DS_Store", "clip/Thumbs.db")), "right", "", close(pictures(), 0.01)),
    Row("names with spaces, quotes and a dollar sign", quotes, "right", "", close(pictures(), 0.01)),
    Row("names in capitals", named(lambda k: f"{k:04d}.PNG"), "right", "", close(pictures(), 0.01)),
    Row("names of copies", named(lambda k: f"IMG_{k:04d} (2).png"), "right", "", close(pictures(), 0.01)),
    Row("one picture twice in the folder as jpg and png", folder_of(pictures(),
        change=lambda folder: write_jpeg(folder / "clip/0003.jpg", read_png(folder / "clip/0003.png"))), "refused",
        "carry the same frame number"),
    Row("names whose zeros change", named(lambda k: f"{k + 95:0{2 if k < 3 else 5}d}.png"), "right", "",
        close(pictures(), 0.01)),
    Row("names in hexadecimal numbers", named(lambda k: f"frame_{k:02x}.png"), "refused",
        "carry the same frame number"),
    Row("names of a counter that begins again", named(lambda k: f"IMG_{(9994 + k) % 10000:04d}.png"), "told",
        "between IMG_0005.png and IMG_9994.png"),
    Row("pictures whose names begin with a dot", named(lambda k: f".{k:04d}.png"), "refused",
        "12 files whose name begins with a dot"),
    Row("names that are long", named(lambda k: "a" * 230 + f"{k:04d}.png"), "refused", "at most 200 bytes"),
    Row("names with the number of frames", named(lambda k: f"f_{k + 1}of12.png"), "right", "", size(WIDTH, HEIGHT)),
    Row("pictures, interlaced", folder_of(woven()), "told", "interlaced-pictures"),
    Row("pictures, grey", folder_of([p[..., 0] for p in pictures()]), "refused", "grey picture"),
    Row("pictures, numbered without zeros", named(lambda k: f"{k}.png"), "right", "", close(pictures(), 0.01)),
    *(Row(f"pictures, {kind} cut off", folder_of(pictures(), change=shortened(kind)), "refused",
        "damaged") for kind in ("tif", "webp", "bmp")),
    Row("pictures of two sizes", folder_of([*pictures(3), picture(3)[:80]]), "refused", "128x80 pixels, others 128x96"),
    Row("pictures, black", folder_of([picture(0) * 0] * 5), "refused", "5 of 5 frames are black"),
    Row("pictures, one under many names", folder_of([picture(0)] * 5), "refused", "all 5 frames are one picture"),
    Row("pictures, negatives", folder_of([255 - p for p in pictures()]), "told", "negative-pictures"),
    Row("pictures, red and blue exchanged", folder_of([p[..., ::-1] for p in pictures()]), "told", "blue-pictures"),
    Row("pictures, every picture twice", folder_of(TWICE), "told", "without the copies: --frames ::2"),
    Row("pictures beside masks, depth, times and a calibration", pair(change=with_files("masks/0.png", "depth/0.png",
        "times.txt", "calib.yaml")), "told",
        "not read: calib.yaml, depth/, masks/; see --masks, --depth, --calibration"),
    Row("pictures, others of a kind that is not read", folder_of(pictures(), change=of_another_kind), "told",
        "not read: 5 files .jp2"),
    Row("pictures, one empty file", one_file(lambda path: path.write_bytes(b"")), "refused", "0003.png"),
    Row("pictures, one with zeros inside", one_file(zeroed), "refused", "0003.png"),
    Row("pictures, a link to itself", one_file(looped), "refused", "0003.png"),
    Row("pictures, a name with a line break", one_file(lambda path: path.rename(path.with_name("00\n03.png"))),
        "refused", "use"),
    Row("pictures, heic", named(lambda k: f"{k:04d}.heic"), "refused", "12 files that end in .heic; convert"),
    Row("pictures, letterbox", folder_of(letterbox()), "told", "--crop 0 16 128 64 keeps the rest"),
    Row("pictures of two cameras by their last number", named(lambda k: f"{k // 2:04d}_{k % 2}.png"), "told",
        "if these are two cameras"),
    Row("pictures, names of a browser", named(lambda k: f"{k}.jfif"), "refused", "let their names end in .jpg"),
    Row("pictures, links to files", folder_of(pictures(), change=links), "right", "", close(pictures(), 0.01)),
    Row("pictures, a broken link", folder_of(pictures(), change=broken_link), "refused", "0003.png: cannot be read"),
    Row("pictures, two names in other case", folder_of(pictures(),
        change=lambda folder: shutil.copy(folder / "clip/0003.png", folder / "clip/0003.PNG")), "refused",
        "carry the same frame number"),
    Row("pictures, another clip in a corner", of_tissue(with_inset), "told", "in the upper right corner"),
    Row("pictures, every second one blended", blended, "told", "every second picture is the mean of its neighbours"),
    Row("pictures, text of a console", of_tissue(lambda shown, i: with_text(shown)), "told", "burnt-in"),
    Row("pictures, two recordings side by side", of_tissue(lambda shown, i: np.hstack([shown,
        255 - tissue(FRAMES - 1 - i)])), "told", "a straight border crosses the pictures at column"),
    Row("pictures, the grey desktop of a console beside them", of_tissue(lambda shown, i: bars(shown)), "told",
        "a straight border crosses the pictures at column"),
    Row("pictures, two of them exchanged", folder_of(exchanged_frames(slow())), "told", "exchanged-frames"),
    Row("pictures, one half of a frame lost", one_changed(green), "told", "has exactly the colour 0 135 0"),
    Row("pictures, a blue screen between", one_changed(lambda shown: np.full_like(shown, (0, 0, 255))), "told",
        "does not resemble"),
    Row("pictures, one of them grey", one_changed(lambda shown: shown[..., 0]), "refused", "grey picture"),
]  # fmt: skip
