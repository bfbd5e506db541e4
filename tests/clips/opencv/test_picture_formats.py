"""TIFF, WebP and BMP pictures: files have their pixels, and damaged, huge, double or transparent ones are refused."""

import io
import logging
import struct

import numpy as np
import pytest
from PIL import Image

from endonerf_writer import write_endonerf
from endotsr.clips.formats.picture_fields import colours_differ
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.depth_files import FILES, read_plane
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER, SequenceConfig
from endotsr.errors import InputError
from endotsr.results.evaluation.pictures import read_render

RNG = np.random.default_rng(3)
COLOUR = RNG.integers(0, 256, (33, 47, 3), np.uint8)
GREY = COLOUR[:, :, 0]
LOSSLESS = {  # kind of file: options of Pillow
    "tiff": {}, "tif": {"compression": "tiff_lzw"}, "TIFF": {"compression": "tiff_adobe_deflate"}, "bmp": {},
    "webp": {"lossless": True},
}  # fmt: skip


def saved(pixels, ending, **how):
    out = io.BytesIO()
    picture = pixels if isinstance(pixels, Image.Image) else Image.fromarray(pixels)
    picture.save(out, {"tif": "tiff"}.get(ending.lower(), ending), **how)
    return out.getvalue()


def written(folder, data, ending):
    file = folder / f"a.{ending}"
    file.write_bytes(data)
    return file


@pytest.mark.parametrize("ending", LOSSLESS)
@pytest.mark.parametrize("pixels", [COLOUR, GREY], ids=["colour", "grey"])
def test_the_pixels_are_those_that_were_written(pixels, ending, tmp_path):
    found = read_picture(written(tmp_path, saved(pixels, ending, **LOSSLESS[ending]), ending))
    wanted = np.repeat(pixels[..., None], 3, 2) if ending == "webp" and pixels.ndim == 2 else pixels  # has no grey
    np.testing.assert_array_equal(found, wanted)


def test_further_kinds_of_pixels(tmp_path):
    black_and_white = written(tmp_path, saved(Image.fromarray(GREY > 99), "tiff"), "tiff")
    np.testing.assert_array_equal(read_picture(black_and_white), np.where(GREY > 99, 255, 0))
    few = COLOUR // 128 * 255
    palette = written(tmp_path, saved(Image.fromarray(few).quantize(8), "bmp"), "bmp")
    np.testing.assert_array_equal(read_picture(palette), few)
    opaque = written(tmp_path, saved(np.dstack([COLOUR, np.full_like(GREY, 255)]), "webp", lossless=True), "webp")
    np.testing.assert_array_equal(read_picture(opaque), COLOUR)
    import cv2

    deep = COLOUR.astype(np.uint16) * 257  # Pillow would take its upper bytes alone
    sixteen = written(tmp_path, cv2.imencode(".tiff", deep[:, :, ::-1])[1].tobytes(), "tiff")
    np.testing.assert_array_equal(read_picture(sixteen), deep)


@pytest.mark.parametrize("ending", LOSSLESS)
@pytest.mark.parametrize("part", [0.0, 0.02, 0.3, 0.9, 0.99])
def test_a_file_that_is_cut_off_is_refused_in_one_line(ending, part, tmp_path, capfd):
    data = saved(COLOUR, ending, **LOSSLESS[ending])
    file = written(tmp_path, data[: int(part * len(data))], ending)
    with pytest.raises(InputError) as refused:
        read_picture(file)
    assert str(file) in str(refused.value) and "\n" not in str(refused.value)
    assert capfd.readouterr() == ("", "")


def turned(ending):
    exif = Image.Exif()
    exif[0x0112] = 3
    return saved(COLOUR, ending, exif=exif)


def transparent(ending):
    return saved(np.dstack([COLOUR, GREY]), ending)


def huge_bmp(_):
    data = bytearray(saved(COLOUR, "bmp"))
    data[18:26] = struct.pack("<ii", 60000, 60000)
    return bytes(data)


def huge_tiff():
    """A header alone: 60000x60000, grey, uncompressed."""
    entries = [(256, 60000), (257, 60000), (258, 8), (259, 1), (262, 1), (273, 8), (278, 60000), (279, 1)]
    tags = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + tags + bytes(4)


def huge_webp(form):
    size = {
        "VP8X": bytes(4) + (16382).to_bytes(3, "little") * 2,
        "VP8L": b"\x2f" + struct.pack("<I", 16382 | 16382 << 14) + bytes(5),
        "VP8 ": b"\x10\0\0\x9d\x01\x2a" + struct.pack("<HH", 16383, 16383),
    }[form]
    body = b"WEBP" + form.encode() + struct.pack("<I", len(size)) + size
    return b"RIFF" + struct.pack("<I", len(body)) + body


REFUSED = {
    "turned tiff": ("tiff", turned("tiff"), "orientation 3"),
    "turned webp": ("webp", turned("webp"), "orientation 3"),
    "transparent tiff": ("tiff", transparent("tiff"), "has transparent pixels"),
    "transparent webp": ("webp", transparent("webp"), "has transparent pixels"),
    "half transparent grey tiff": ("tiff", saved(Image.fromarray(COLOUR[:, :, :2], "LA"), "tiff"), "of the mode LA"),
    "huge tiff": ("tiff", huge_tiff(), "60000x60000 pixels; use at most"),
    "another kind": ("tiff", saved(COLOUR, "bmp"), "not a TIFF file by its first bytes; it is a BMP file: let its name"
                     " end in .bmp"),
    "png named webp": ("webp", saved(COLOUR, "png"), "it is a PNG file: let its name end in .png"),
    "tiff named jpg": ("jpg", saved(COLOUR, "tiff"), "it is a TIFF file: let its name end in .tif"),
    "webp named bmp": ("bmp", saved(COLOUR, "webp"), "it is a WebP file: let its name end in .webp"),
    "jpg named png": ("png", saved(COLOUR, "jpeg"), "it is a JPEG file: let its name end in .jpg"),
    "huge bmp": ("bmp", huge_bmp(""), "60000x60000 pixels; use at most"),
    **{f"huge webp {form}": ("webp", huge_webp(form), "16383x16383 pixels; use at most")
       for form in ("VP8X", "VP8L", "VP8 ")},
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_would_be_read_wrong_is_refused(case, tmp_path):
    ending, data, said = REFUSED[case]
    with pytest.raises(InputError, match=said):
        read_picture(written(tmp_path, data, ending))


@pytest.mark.parametrize("ending", ["png", "jpeg", "tiff", "webp"])
def test_a_colour_profile_other_than_srgb_is_named(ending, tmp_path):
    from PIL import ImageCms

    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for profile, named in ((None, False), (srgb, False), (b"Display P3" * 20, True)):
        how = {"icc_profile": profile} if profile else {}
        assert colours_differ(written(tmp_path, saved(COLOUR, ending, **how), ending)) is named
    assert not colours_differ(tmp_path / "missing.png") and not colours_differ(written(tmp_path, b"", "webp"))


@pytest.mark.parametrize("ending", ["tiff", "bmp", "webp"])
def test_every_folder_of_pictures_takes_them(ending, tmp_path):
    """Pictures and masks of a clip, its check, and the renders of another program."""
    clip = simulate(SimulatorSettings(width=64, height=48, frames=9)).sequence
    write_endonerf(clip, tmp_path / "clip")
    expected = read_sequence(tmp_path / "clip", SequenceConfig())
    for file in [*(tmp_path / "clip/images").iterdir(), *(tmp_path / "clip/masks").iterdir()]:
        written(file.parent, saved(Image.open(file), ending, **LOSSLESS[ending]), ending).rename(
            file.with_suffix(f".{ending}")
        )
        file.unlink()
    found = read_sequence(tmp_path / "clip", SequenceConfig())
    np.testing.assert_array_equal(found.images, expected.images)
    np.testing.assert_array_equal(found.masks, expected.masks)
    assert check_sequence(tmp_path / "clip", PAPER).findings == []
    if ending != "webp":  # of renders, only kinds without loss are measured
        shape = (3, 48, 64)
        file = sorted((tmp_path / "clip/images").iterdir())[0]
        np.testing.assert_array_equal(read_render(file, shape), expected.images[0].astype(np.float32) / 255)


@pytest.mark.parametrize("ending", FILES.listed)
def test_a_depth_file_of_every_listed_ending_has_a_reader(tmp_path, ending):
    with pytest.raises(InputError) as refusal:
        read_plane(written(tmp_path, b"0", ending[1:]))
    assert "by its name" not in str(refusal.value)


def test_pillow_prints_nothing_about_a_damaged_file(tmp_path, monkeypatch, capfd):
    """Its log reaches standard error where the program has no other place for it, as in a command."""
    data = saved(COLOUR, "tiff")
    tag = struct.pack("<HHI", 277, 3, 1)  # samples per pixel
    assert tag in data
    monkeypatch.setattr(logging.root, "handlers", [])
    with pytest.raises(InputError, match="damaged TIFF"):
        read_picture(written(tmp_path, data.replace(tag + b"\3\0", tag + b"\1\1"), "tiff"))
    assert capfd.readouterr().err == ""
