"""Rows of `inputs_tried.py` about masks: numbers, files of other programs, videos of masks."""

from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import each, folder_of, of_all_frames, rewritten, tiff, twelve, with_file
from input_rows import refused, right, told
from made_videos import HEIGHT, WIDTH, files, pictures, write
from PIL import Image

from endotsr.clips.formats.conversions import LOADS as LOADS_OF
from endotsr.clips.opencv.png import read_png, write_png


def mask(value=255):
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    plane[:, :40] = value
    return plane


@builder
def masked(folder: Path, frames=None, *words: str, count=12, change=lambda folder: None) -> list[str]:
    """The usual pictures with masks, of which one array is that of all."""
    given = mask() if frames is None else frames
    files(folder, "m", (given if isinstance(given, list) else [given] * 12)[:count])
    change(folder / "m")
    return [*twelve()(folder), "--masks", str(folder / "m"), *words]


def half_excluded(folder: Path) -> bool:
    return abs((read_png(folder / "o/masks/000003.png") > 0).mean() - 40 / WIDTH) < 0.01


def as_transparency(folder: Path) -> None:
    """Masks as drawing programs write them: black, and transparent where nothing is marked."""

    def changed(opened):
        black = Image.new("RGB", opened.size)
        black.putalpha(opened)
        return black

    rewritten(folder, changed)


def labels(*colour: int):
    """Masks with a palette in which 1 has this colour, as tools that annotate instruments store them."""

    def changed(opened):
        made = opened.point(lambda value: value // 255).convert("P")
        made.putpalette([0, 0, 0, *colour])
        return made

    return lambda folder: rewritten(folder, changed)


def united_masks(folder: Path) -> list[str]:
    """Two sets of masks, each of which excludes a part of what both do."""
    files(folder, "b", [np.where(np.arange(WIDTH) < 20, mask(), 0).astype(np.uint8)] * 12)
    return masked(np.where(np.arange(WIDTH) < 20, 0, mask()).astype(np.uint8), "--unite-masks", str(folder / "b"))(
        folder
    )


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
def with_tool(folder: Path, masks: np.ndarray, *words: str) -> list[str]:
    """Red tissue and a grey instrument in the left columns, with these masks."""
    words_of = masked(masks, *words)(folder)
    each(
        "clip", lambda shown: np.where(mask()[..., None] > 0, shown.mean(axis=2, keepdims=True), shown).astype(np.uint8)
    )(folder)
    return words_of


HARD, SMOOTH = (with_empty([plane] * 12, lambda i: mask(0)) for plane in (mask(), smooth()))


def flipped(folder: Path) -> list[str]:
    """A grey instrument at the left, and mirrored masks of it."""
    shown, plane = pictures(), mask()
    plane[:20], plane[80:] = 0, 0
    for frame in shown:
        frame[plane > 0] = 110
    files(folder, "m", [plane[:, ::-1]] * 12)
    return [*folder_of(shown)(folder), "--masks", str(folder / "m")]


def of_the_masks_command(folder: Path) -> list[str]:
    """The folder that `endotsr masks` wrote, with its pictures, in place of the masks in it."""
    words = masked()(folder)
    (folder / "m").rename(folder / "masks")
    (folder / "m").mkdir()
    (folder / "masks").rename(folder / "m/masks")
    (folder / "m/proposal.json").write_text("{}")
    write_png(folder / "m/proposed_masks.png", pictures()[0])
    return words


@builder
def mask_files(folder: Path, save, ending: str) -> list[str]:
    """Masks that `save` writes; it gets the path and the plane."""
    (folder / "m").mkdir()
    for i in range(12):
        save(folder / "m" / f"{i:04d}{ending}", mask())
    return [*twelve()(folder), "--masks", str(folder / "m")]


def by_pillow(ending: str, change=lambda plane: plane):
    return mask_files(lambda path, plane: Image.fromarray(change(plane)).save(path), ending)


def blurred(plane: np.ndarray) -> np.ndarray:
    """Numbers from 0 to 0.98."""
    values = (plane > 0).astype(np.float32) * 0.98
    for _ in range(3):
        values = (np.roll(values, 1, axis=1) + values + np.roll(values, -1, axis=1)) / 3
    return values.astype(np.float32)


OBJECTS = mask(1) + mask(1) * (np.arange(WIDTH) < 20).astype(np.uint8)  # numbers of two instruments
SMALL = np.maximum(mask(2), (np.indices((HEIGHT, WIDTH)) - [[[0]], [[60]]] < 4).all(axis=0).astype(np.uint8))
LOADS = {load: ending for ending, (_, load) in LOADS_OF.items()}
MASK_ROWS = [
    right("masks, right", masked(), half_excluded),
    refused("masks, one missing", masked(count=11), "1 of 12 frames have no mask"),
    told("masks, missing, --gaps drop", masked(None, "--gaps", "drop", count=11), "left out"),
    right("masks, of half the size", masked(mask()[::2, ::2]), half_excluded),
    refused("masks, stored as transparency", masked(change=as_transparency), "a mask that is stored as transparency"),
    refused("masks, of other proportions", masked(mask()[:50]), "another aspect ratio"),
    refused("masks, soft", masked((mask() // 2 + np.arange(WIDTH)).astype(np.uint8)), "this is not a mask"),
    told("masks united", united_masks, "masks: united with", half_excluded),
    right("masks, 0 and 1", masked(mask(1)), half_excluded),
    right("masks, jpg", masked(change=jpg), half_excluded),
    refused("masks, coloured labels", masked(change=labels(128, 0, 0)), "one grey channel expected"),
    refused("masks, numbers of objects, one of them small", masked(SMALL), "nonzero the numbers of several objects"),
    right("masks, numbers of objects, --excluded-value nonzero", masked(OBJECTS, "--excluded-value", "nonzero"),
        half_excluded),
    right("masks, noise of a codec in frames without an instrument", masked(CODED), as_read(CODED)),
    right("masks, dark jpg in frames without an instrument", masked(CODED, change=jpg), as_read(CODED)),
    right("masks, two small numbers in a frame without an instrument", masked(with_empty([coded(i) for i in range(12)],
        lambda i: noise(i, 1))), as_read(CODED)),
    right("masks, smooth edges", masked(SMOOTH), as_read(SMOOTH)),
    told("masks, a video", of_video(HARD), "pairs 000000 with the first frame", as_read(HARD)),
    refused("masks, a video of other length", of_video(HARD[:11]), "1 of 12 frames have no mask"),
    refused("masks, a video of half the frame rate", of_video(HARD[::2]), "its 6 pictures belong to the first 6 of 12"),
    told("masks, a video of half the frame rate, --gaps drop", of_video(HARD[::2], "--gaps", "drop"),
        "if it has another frame rate, write one picture per frame"),
    refused("masks, a video of colours", of_video([np.roll(p[..., 0], 5) for p in pictures()], name="m.mkv"),
        "this is not a mask"),
    right("masks, 16 and 235", masked((mask() // 255 * 219 + 16).astype(np.uint8)), half_excluded),
    refused("masks, classes in steps of 32", masked((mask(32) + np.roll(mask(64), 60, 1)).astype(np.uint8)),
        "the largest of all pictures is 64"),
    refused("masks, 0 and 1 in one of them", masked([mask(1) if i == 3 else mask() for i in range(12)]),
        "areas of the number 1"),
    refused("masks, one of 16 bits", masked(change=lambda folder: write_png(folder / "0003.png",
        mask().astype(np.uint16) * 257)), "one bit depth"),
    told("masks, inverted, in prepare", with_tool(255 - mask()), "68.8% would be"),
    told("masks, inverted, in prepare, the remedy", with_tool(255 - mask(), "--excluded-value", "black"),
        "masks: black = excluded: 68.8% of the pixels are tissue", half_excluded),
    told("masks, of a grey instrument", with_tool(mask()), "masks: white = excluded: 68.8% of the pixels are tissue",
        half_excluded),
    refused("masks, jpg, --excluded-value nonzero", masked(CODED, "--excluded-value", "nonzero", change=jpg),
        "different numbers, as a JPEG"),
    right("masks, with a palette of black and white", masked(change=labels(255, 255, 255)), half_excluded),
    told("masks, one array in the order of names as text", of_all_frames(lambda k: np.roll(mask(), 5 * k, axis=1) > 0,
        "--masks"), "10.png stands in the place of 2.png"),
    refused("masks, TIFF of probabilities", by_pillow(".tif", blurred), "a threshold, such as > 0.5"),
    right("masks, TIFF of 0 and 1 as numbers with a point", by_pillow(".tif", lambda plane: plane / np.float32(255)),
        half_excluded),
    refused("masks, TIFF of 16 bit in which 0 is white", mask_files(lambda path, plane: tiff(path,
        65535 - 257 * plane.astype(np.uint16), 0, 16), ".tif"), "states that 0 is white"),
    right("masks, TIFF of 8 bit in which 0 is white", mask_files(lambda path, plane: tiff(path, 255 - plane, 0, 8),
        ".tif"), half_excluded),
    *(right(f"masks, {name} of 1 bit", by_pillow(f".{name}", lambda plane: plane > 0),
        half_excluded) for name in ("png", "tif", "bmp")),
    right("masks, TIFF of int32", by_pillow(".tif", lambda plane: (plane > 0).astype(np.int32)), half_excluded),
    right("masks, smooth edges, of another size", mask_files(lambda path, plane: Image.fromarray(plane).resize((300,
        225), Image.Resampling.BICUBIC).save(path), ".png"), half_excluded),
    right("masks, the folder that endotsr masks wrote", of_the_masks_command, half_excluded),
    told("masks, mirrored", flipped, "flipped-masks"),
    *(refused(f"masks, {ending[1:]} of each frame", mask_files(lambda path, plane: path.write_bytes(b"x"), ending),
        load) for load, ending in LOADS.items()),
    *(refused(f"masks, one {ending[1:]} of all frames", with_file("--masks", f"m{ending}", b"x"), load) for load,
        ending in LOADS.items()),
    refused("masks, logits of a network", mask_files(lambda path, plane: np.save(path, plane / 12.75 - 10.0), ".npy"),
        'numpy.save("0000.npy", array > 0)'),
    refused("masks, annotations of COCO", with_file("--masks", "m.json", '{"images": []}'),
        "outlines of an annotation program are not read"),
    refused("masks, one folder per object", with_file("--masks", "m", lambda path: [files(path, name,
        [mask()] * 12) for name in "12"]), "it holds the folders 1, 2: give one of them"),
    refused("masks, one JSON per frame", mask_files(lambda path, plane: path.write_text("{}"), ".json"),
        "it holds 12 files of the ending .json; outlines of an annotation program are not read"),
    refused("masks, GIF", by_pillow(".gif"), "it holds 12 files of the ending .gif"),
    right("masks, pictures and masks in one npz", mask_files(lambda path, plane: np.savez(path, imgs=np.zeros((HEIGHT,
        WIDTH, 3)), gts=plane // 255), ".npz"), half_excluded),
    refused("masks, two objects in an array", with_file("--masks", "m.npy", lambda path: np.save(path, np.zeros((12, 2,
        HEIGHT, WIDTH), bool))), "(12, 2, 96, 128); use one array"),
]  # fmt: skip
