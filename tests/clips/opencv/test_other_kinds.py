"""Pictures that are not RGB of 8 bits are refused with the kind of the picture, and with a remedy that works."""

import re

import cv2
import numpy as np
import pytest
from PIL import Image

from endotsr.cli.main import main
from endotsr.clips.opencv.other_kinds import is_mosaic

SIZE = (48, 64)


def scene(colour: bool = True) -> np.ndarray:
    """Smooth red tissue of 8 bits, or one channel of it."""
    x, y = np.meshgrid(np.linspace(0, 6, SIZE[1]), np.linspace(0, 6, SIZE[0]))
    shown = np.stack([150 + 50 * np.sin(x), 60 + 30 * np.cos(y), 50 + 20 * np.sin(x + y)], axis=-1)
    return shown.astype(np.uint8) if colour else shown[..., 0].astype(np.uint8)


def mosaic() -> np.ndarray:
    """What a sensor with red, green, green and blue pixels measures."""
    colours, found = scene(), np.zeros(SIZE, np.uint8)
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        found[row::2, column::2] = colours[row::2, column::2, channel]
    return found


KINDS = {
    "grey": (".png", scene(colour=False), "grey picture; images must be RGB: write copies by Pillow"),
    "1 bit": (".png", scene(colour=False) > 150, "grey picture of two values, as masks have them; .* give masks by"),
    "mosaic": (".png", mosaic(), "grey picture that seems to be the mosaic of a colour sensor"),
    "16 bit": (".png", scene().astype(np.uint16) * 16, r"16-bit picture; .* largest number here is 3\d+: F = 255/4095"),
    "grey, 16 bit": (".tif", scene(colour=False).astype(np.uint16) * 257, "16-bit picture; .* F = 255/65535 if"),
    "float": (".tif", scene(colour=False).astype(np.float32) / 255, r"32-bit picture; .* here is 0.78\d*: F = 255/1"),
    "colours of float": (".tif", scene().astype(np.float32) / 255, "not read, such as colours of floating-point"),
}


def folder_of(path, pixels: np.ndarray, ending: str):
    path.mkdir()
    for i in range(5):
        file, shown = path / f"{i:03d}{ending}", np.roll(pixels, 2 * i, axis=1)
        if pixels.dtype == bool:
            Image.fromarray(shown).save(file)
        else:
            cv2.imwrite(str(file), shown[..., ::-1] if shown.ndim == 3 else shown)
    return path


def prepared(source, out, capsys) -> str:
    """What `prepare` said on standard error."""
    capsys.readouterr()
    main(["prepare", str(source), "--out", str(out), "--camera", "60", "60", "32", "24"])
    return capsys.readouterr().err


@pytest.mark.parametrize("kind", KINDS)
def test_another_kind_of_picture_is_refused_with_a_remedy_that_works(kind, tmp_path, capsys):
    ending, pixels, said = KINDS[kind]
    source = folder_of(tmp_path / "source", pixels, ending)
    message = prepared(source, tmp_path / "out", capsys)
    assert re.search(said, message) and message.count("\n") == 1, message
    command = re.search(r"(Image\.open|cv2\.imwrite)\(.*?(?=, with |; |$)", message.strip())
    factor = re.search(r"F = 255/(\d+)", message)
    assert command, message
    (tmp_path / "copies").mkdir()
    for file in source.iterdir():
        names = {"cv2": cv2, "Image": Image, "A": str(file), "B": str(tmp_path / "copies" / f"{file.stem}.png")}
        eval(command[0], names | {"F": 255 / int(factor[1]) if factor else 255.0})
    assert prepared(tmp_path / "copies", tmp_path / "out", capsys) == ""
    shown = cv2.imread(str(min((tmp_path / "out/images").iterdir())))[..., ::-1]
    if kind in ("mosaic", "16 bit", "colours of float"):
        assert np.abs(shown.astype(int) - scene())[4:-4, 4:-4].max() <= 6, "the colours of the scene"


def test_smooth_and_noisy_pictures_are_no_mosaic():
    rng = np.random.default_rng(0)
    assert is_mosaic(mosaic())
    assert not is_mosaic(scene(colour=False)) and not is_mosaic(mosaic()[:2])
    assert not is_mosaic(rng.integers(0, 256, SIZE, dtype=np.uint8))
    assert not is_mosaic(np.repeat(rng.integers(0, 256, (1, SIZE[1]), dtype=np.uint8), SIZE[0], axis=0)), "stripes"
