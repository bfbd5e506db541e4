"""Rows of `inputs_tried.py` about masks with other numbers than 0 and 255: coded, smooth, numbered, in a video."""

from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import Row, folder_of, half_excluded, mask, masked, rewritten
from made_videos import HEIGHT, WIDTH, pictures, write

from endotsr.clips.opencv.png import read_png, write_png

EMPTY = (5, 8)  # frames without an instrument


def noise(i: int, most: int = 10) -> np.ndarray:
    """A black picture with small numbers, in areas as a codec leaves them."""
    rough = np.random.default_rng(i).integers(0, most + 1, (HEIGHT // 8, WIDTH // 8))
    return np.kron(rough, np.ones((8, 8))).astype(np.uint8)


def coded(i: int) -> np.ndarray:
    """A mask with the numbers of a codec: small ones in the black, large ones in the white, grey at the edge."""
    plane = np.where(mask() > 0, 255 - noise(i), noise(i)).astype(np.uint8)
    plane[:, 39:41] = np.array([170, 80])
    plane[::7, 39:41] = np.array([150, 60])
    return plane


def with_empty(frames: list[np.ndarray], empty) -> list[np.ndarray]:
    return [empty(i) if i in EMPTY else frame for i, frame in enumerate(frames)]


CODED = with_empty([coded(i) for i in range(12)], noise)


def smooth() -> np.ndarray:
    """A round mask with an edge of two pixels."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return np.clip(255 * (30.5 - np.hypot(x - 50, y - 40)) / 2, 0, 255).astype(np.uint8)


@builder
def as_read(folder: Path, frames: list[np.ndarray]) -> bool:
    """The written masks exclude what is brighter than the middle, and nothing in a frame without an instrument."""
    found = [read_png(file) > 0 for file in sorted((folder / "o/masks").iterdir())]
    apart = [np.mean(one != (frame >= 128)) for one, frame in zip(found, frames, strict=True)]
    return max(apart) < 0.03 and not any(found[i].any() for i in EMPTY if not (frames[i] >= 128).any())


def jpg(folder: Path) -> None:
    rewritten(folder, ending="jpg", quality=30)


@builder
def of_video(folder: Path, frames: list[np.ndarray], *words: str, name: str = "m.mp4", **how) -> list[str]:
    """The masks as a video."""
    write(folder / name, [np.repeat(frame[..., None], 3, axis=2) for frame in frames], **how)
    return [*folder_of(pictures())(folder), "--masks", str(folder / name), *words]


@builder
def exported(folder: Path, frames: list[np.ndarray]) -> list[str]:
    """The masks as pictures that were exported from a video of them."""
    words = of_video(frames, options={"crf": "38"})(folder)
    (folder / "m").mkdir()
    with av.open(str(folder / "m.mp4")) as container:
        for i, frame in enumerate(container.decode(video=0)):
            write_png(folder / "m" / f"{i:04d}.png", frame.to_ndarray(format="rgb24"))
    return [str(folder / "m") if word == str(folder / "m.mp4") else word for word in words]


def void() -> np.ndarray:
    """Objects 1 and 2, and 255 where the annotator left a border open."""
    plane = mask(1)
    plane[:30, 60:90], plane[50:60, 60:64] = 2, 255
    return plane


@builder
def with_tool(folder: Path, masks: list[np.ndarray], *words: str) -> list[str]:
    """Red tissue and a grey instrument in the left columns, with these masks."""
    words_of = masked(masks, *words)(folder)
    for file in (folder / "clip").iterdir():
        pixels = read_png(file).copy()
        pixels[:, :40] = pixels[:, :40].mean(axis=2, keepdims=True)
        write_png(file, pixels)
    return words_of


HARD = with_empty([mask()] * 12, lambda i: mask(0))
MASK_ROWS = [
    Row("masks, noise of a codec in frames without an instrument", masked(CODED), "right", "", as_read(CODED)),
    Row("masks, dark jpg in frames without an instrument", masked(CODED, change=jpg), "right", "", as_read(CODED)),
    Row("masks, two small numbers in a frame without an instrument", masked(with_empty([coded(i) for i in range(12)],
        lambda i: noise(i, 1))), "right", "", as_read(CODED)),
    Row("masks, smooth edges", masked(with_empty([smooth()] * 12, lambda i: mask(0))), "right", "",
        as_read(with_empty([smooth()] * 12, lambda i: mask(0)))),
    Row("masks, exported from a video", exported(HARD), "right", "", as_read(HARD)),
    Row("masks, a video", of_video(HARD), "told", "pairs 000000 with the first frame", as_read(HARD)),
    Row("masks, a video of H.265 of low quality", of_video(HARD, codec="libx265", options={"crf": "40"}), "told",
        "pairs 000000 with the first frame", as_read(HARD)),
    Row("masks, a video of other length", of_video(HARD[:11]), "refused", "1 of 12 frames have no mask"),
    Row("masks, a video of colours", of_video([np.roll(p[..., 0], 5) for p in pictures()], name="m.mkv"), "refused",
        "this is not a mask"),
    Row("masks, 16 and 235", masked([(mask() // 255 * 219 + 16).astype(np.uint8)] * 12), "right", "", half_excluded),
    Row("masks, 0 and 2", masked([mask(2)] * 12), "right", "", half_excluded),
    Row("masks, numbers of objects and 255 for none", masked([void()] * 12), "refused", "areas of the number"),
    Row("masks, classes in steps of 32", masked([(mask(32) + np.roll(mask(64), 60, 1)).astype(np.uint8)] * 12),
        "refused", "the largest of all pictures is 64"),
    Row("masks, 0 and 1 in one of them", masked([mask(1) if i == 3 else mask() for i in range(12)]), "refused",
        "areas of the number 1"),
    Row("masks, one of 16 bits", masked([mask()] * 12, change=lambda folder: write_png(folder / "0003.png",
        mask().astype(np.uint16) * 257)), "refused", "one bit depth"),
    Row("masks, inverted, in prepare", with_tool([255 - mask()] * 12), "told",
        "68.8% would be"),
    Row("masks, inverted, in prepare, the remedy", with_tool([255 - mask()] * 12, "--excluded-value", "black"), "told",
        "masks: black = excluded: 68.8% of the pixels are tissue", half_excluded),
    Row("masks, of a grey instrument", with_tool([mask()] * 12), "told",
        "masks: white = excluded: 68.8% of the pixels are tissue", half_excluded),
    Row("masks, jpg, --excluded-value nonzero", masked(CODED, "--excluded-value", "nonzero", change=jpg), "refused",
        "different numbers, as a JPEG"),
]  # fmt: skip
