"""Rows of `inputs_tried.py` about masks: numbers, files of other programs, videos of masks."""

import json
from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import Row, folder_of, of_all_frames, rewritten, tiff
from made_videos import HEIGHT, WIDTH, files, pictures, write
from PIL import Image

from endotsr.clips.formats.conversions import LOADS as LOADS_OF
from endotsr.clips.opencv.png import read_png, write_png


def masked(frames, *words: str, count=12, change=lambda folder: None):
    changed = change

    def change(folder: Path) -> None:
        files(folder, "m", frames[:count])
        changed(folder / "m")

    def make(folder: Path) -> list[str]:
        return [*folder_of(pictures(), change=change)(folder), "--masks", str(folder / "m"), *words]

    return make


def mask(value=255):
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    plane[:, :40] = value
    return plane


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
    parts = [mask(), mask()]
    parts[0][:, 20:], parts[1][:, :20] = 0, 0
    for name, part in zip("ab", parts):
        files(folder, name, [part] * 12)
    words = folder_of(pictures())(folder)
    return [*words, "--masks", str(folder / "a"), "--unite-masks", str(folder / "b")]


def two_labels(small: int) -> np.ndarray:
    """Object 2 in the left columns, and a square of object 1."""
    plane = mask(2)
    plane[:small, 60 : 60 + small] = 1
    return plane


def three_labels() -> np.ndarray:
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    for k in range(3):
        plane[:, 30 * k : 30 * k + 30] = k + 1
    return plane


def objects(i: int) -> np.ndarray:
    """Numbers of two instruments: 1 and 2."""
    return mask(1) + mask(1) * (np.arange(WIDTH) < 20).astype(np.uint8)


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
def exported_from_video(folder: Path, frames: list[np.ndarray]) -> list[str]:
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


def coloured_masks(folder: Path) -> None:
    for file in folder.iterdir():
        write_png(file, np.dstack([mask(), mask(0), mask(0)]))


@builder
def masks_saved(folder: Path, save, ending: str) -> None:
    """Masks as files of another kind; `save` gets the path and the plane."""
    for file in sorted(folder.iterdir()):
        plane = read_png(file)
        file.unlink()
        save(file.with_suffix(ending), plane)


def numbers(factor: float, blur: int = 0):
    """A TIFF of numbers with a point: black and white as 0 and this factor, with edges of this width."""

    def save(path: Path, plane: np.ndarray) -> None:
        values = (plane > 0).astype(np.float32) * factor
        for _ in range(blur):
            values = (np.roll(values, 1, axis=1) + values + np.roll(values, -1, axis=1)) / 3
        Image.fromarray(values.astype(np.float32)).save(path)

    return save


def numbered_from_1(folder: Path) -> list[str]:
    words = masked([mask()] * 12)(folder)
    (folder / "m/0000.png").unlink()
    return words


@builder
def mirrored_masks(folder: Path, flip) -> list[str]:
    """A grey instrument at the left, and masks of it."""
    shown, masks = pictures(), []
    for frame in shown:
        frame[20:80, :40] = 110
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[20:80, :40] = 255
        masks.append(flip(mask))
    files(folder, "m", masks)
    return [*folder_of(shown)(folder), "--masks", str(folder / "m")]


def of_the_masks_command(folder: Path) -> list[str]:
    """The folder that `endotsr masks` wrote, with its pictures, in place of the masks in it."""
    words = masked([mask()] * 12)(folder)
    (folder / "found").mkdir()
    (folder / "m").rename(folder / "found/masks")
    (folder / "found/proposal.json").write_text("{}")
    write_png(folder / "found/proposed_masks.png", pictures()[0])
    return [*words[: words.index("--masks") + 1], str(folder / "found")]


@builder
def mask_files(folder: Path, save, ending: str) -> list[str]:
    """Masks that `save` writes; it gets the path and the plane."""
    (folder / "m").mkdir()
    for i in range(12):
        save(folder / "m" / f"{i:04d}{ending}", mask())
    return [*folder_of(pictures())(folder), "--masks", str(folder / "m")]


@builder
def mask_file(folder: Path, name: str, save) -> list[str]:
    """All masks in one file."""
    save(folder / name)
    return [*folder_of(pictures())(folder), "--masks", str(folder / name)]


def by_object(folder: Path) -> list[str]:
    for name in "12":
        files(folder / "m", name, [mask()] * 12)
    return [*folder_of(pictures())(folder), "--masks", str(folder / "m")]


def saved_by(mode: str, **how):
    """Masks in another mode of Pillow."""
    return lambda folder: rewritten(folder, lambda opened: opened.convert(mode), **how)


LOADS = {ending: load for ending, (_, load) in LOADS_OF.items()}
MASK_ROWS = [
    Row("masks, right", masked([mask()] * 12), "right", "", half_excluded),
    Row("masks, one missing", masked([mask()] * 12, count=11), "refused", "1 of 12 frames have no mask"),
    Row("masks, missing, --gaps drop", masked([mask()] * 12, "--gaps", "drop", count=11), "told", "left out"),
    Row("masks, of half the size", masked([mask()[::2, ::2]] * 12), "right", "", half_excluded),
    Row("masks, stored as transparency", masked([mask()] * 12, change=as_transparency), "refused",
        "a mask that is stored as transparency"),
    Row("masks, of other proportions", masked([mask()[:50]] * 12), "refused", "another aspect ratio"),
    Row("masks, soft", masked([(mask() // 2 + np.arange(WIDTH)).astype(np.uint8)] * 12), "refused",
        "this is not a mask"),
    Row("masks united", united_masks, "told", "masks: united with", half_excluded),
    Row("masks, 0 and 1", masked([mask(1)] * 12), "right", "", half_excluded),
    Row("masks, 0 and 1 of 16 bit", masked([mask(1).astype(np.uint16)] * 12), "right", "", half_excluded),
    Row("masks, jpg", masked([mask()] * 12, change=lambda folder: rewritten(folder, ending="jpg", quality=40)), "right",
        "", half_excluded),
    Row("masks, classes of instruments", masked([mask(1) + mask(1) * (np.arange(WIDTH) < 20)] * 12), "refused",
        "numbers up to 2 in all pictures"),
    Row("masks, coloured labels", masked([mask()] * 12, change=labels(128, 0, 0)), "refused",
        "one grey channel expected"),
    Row("masks, numbers of objects, one of them small", masked([two_labels(4)] * 12), "refused",
        "nonzero the numbers of several objects"),
    Row("masks, numbers of objects, one of them small, stated", masked([two_labels(0)] * 12, "--excluded-value",
        "nonzero"), "right", "", half_excluded),
    Row("masks, numbers of three objects", masked([three_labels()] * 12), "refused",
        "nonzero the numbers of several objects"),
    Row("masks, numbers of objects, --excluded-value nonzero", masked([objects(0)] * 12, "--excluded-value", "nonzero"),
        "right", "", half_excluded),
    Row("masks, noise of a codec in frames without an instrument", masked(CODED), "right", "", as_read(CODED)),
    Row("masks, dark jpg in frames without an instrument", masked(CODED, change=jpg), "right", "", as_read(CODED)),
    Row("masks, two small numbers in a frame without an instrument", masked(with_empty([coded(i) for i in range(12)],
        lambda i: noise(i, 1))), "right", "", as_read(CODED)),
    Row("masks, smooth edges", masked(with_empty([smooth()] * 12, lambda i: mask(0))), "right", "",
        as_read(with_empty([smooth()] * 12, lambda i: mask(0)))),
    Row("masks, exported from a video", exported_from_video(HARD), "right", "", as_read(HARD)),
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
    Row("masks, inverted, in prepare", with_tool([255 - mask()] * 12), "told", "68.8% would be"),
    Row("masks, inverted, in prepare, the remedy", with_tool([255 - mask()] * 12, "--excluded-value", "black"), "told",
        "masks: black = excluded: 68.8% of the pixels are tissue", half_excluded),
    Row("masks, of a grey instrument", with_tool([mask()] * 12), "told",
        "masks: white = excluded: 68.8% of the pixels are tissue", half_excluded),
    Row("masks, jpg, --excluded-value nonzero", masked(CODED, "--excluded-value", "nonzero", change=jpg), "refused",
        "different numbers, as a JPEG"),
    Row("masks, with a palette of black and white", masked([mask()] * 12, change=labels(255, 255, 255)), "right", "",
        half_excluded),
    Row("masks, red", masked([mask()] * 12, change=coloured_masks), "refused", "--excluded-value nonzero"),
    Row("masks, one array in the order of names as text", of_all_frames(lambda k: np.roll(mask(), 5 * k, axis=1) > 0,
        "--masks"), "told", "10.png stands in the place of 2.png"),
    Row("masks, TIFF of probabilities", masked([mask()] * 12, change=masks_saved(numbers(0.98, 3), ".tif")), "refused",
        "a threshold, such as > 0.5"),
    Row("masks, TIFF of 0 and 1 as numbers with a point", masked([mask()] * 12, change=masks_saved(numbers(1.0),
        ".tif")), "right", "", half_excluded),
    Row("masks, TIFF of 0 and 0.5", masked([mask()] * 12, change=masks_saved(numbers(0.5), ".tif")), "refused",
        "holds 0.5; use whole numbers"),
    Row("masks, TIFF of 16 bit in which 0 is white", masked([mask()] * 12, change=masks_saved(lambda path,
        plane: tiff(path, 65535 - 257 * plane.astype(np.uint16), 0, 16), ".tif")), "refused", "states that 0 is white"),
    *(Row(f"masks, TIFF of {bits} bit in which 0 is white", masked([mask()] * 12, change=masks_saved(lambda path, plane,
        bits=bits: tiff(path, (plane == 0) if bits == 1 else 255 - plane, 0, bits), ".tif")), "right", "",
        half_excluded) for bits in (1, 8)),
    *(Row(f"masks, {name} of 1 bit", masked([mask()] * 12, change=masks_saved(lambda path,
        plane: Image.fromarray(plane > 0).save(path), f".{name}")), "right", "", half_excluded) for name in ("png",
        "tif", "bmp")),
    Row("masks, TIFF of int32", masked([mask()] * 12, change=masks_saved(lambda path,
        plane: Image.fromarray((plane > 0).astype(np.int32)).save(path), ".tif")), "right", "", half_excluded),
    Row("masks, smooth edges, of another size", masked([mask()] * 12, change=masks_saved(lambda path,
        plane: Image.fromarray(plane).resize((300, 225), Image.Resampling.BICUBIC).save(path), ".png")), "right", "",
        half_excluded),
    Row("masks numbered from 1, the last one missing", numbered_from_1, "refused", "1 of 12 frames have no mask"),
    Row("masks, the folder that endotsr masks wrote", of_the_masks_command, "right", "", half_excluded),
    Row("masks, mirrored", mirrored_masks(lambda mask: mask[:, ::-1]), "told", "flipped-masks"),
    Row("masks, not mirrored", mirrored_masks(lambda mask: mask), "right"),
    *(Row(f"masks, {ending[1:]} of each frame", mask_files(lambda path, plane: path.write_bytes(b"x"), ending),
        "refused", load) for ending, load in LOADS.items()),
    *(Row(f"masks, one {ending[1:]} of all frames", mask_file(f"m{ending}", lambda path: path.write_bytes(b"x")),
        "refused", load) for ending, load in LOADS.items()),
    Row("masks, logits of a network", mask_files(lambda path, plane: np.save(path, plane / 12.75 - 10.0), ".npy"),
        "refused", 'numpy.save("0000.npy", array > 0)'),
    Row("masks, annotations of COCO", mask_file("m.json", lambda path: path.write_text(json.dumps({"images": []}))),
        "refused", "use a file that ends in one of .png"),
    Row("masks, one folder per object", by_object, "refused", "it holds the folders 1, 2: give one of them"),
    Row("masks, one JSON per frame", mask_files(lambda path, plane: path.write_text("{}"), ".json"), "refused",
        "it holds 12 files of the ending .json"),
    Row("masks, GIF", mask_files(lambda path, plane: Image.fromarray(plane).save(path), ".gif"), "refused",
        "it holds 12 files of the ending .gif"),
    Row("masks, pictures and masks in one npz", mask_files(lambda path, plane: np.savez(path, imgs=np.zeros((HEIGHT,
        WIDTH, 3)), gts=plane // 255), ".npz"), "right", "", half_excluded),
    Row("masks, two objects in an array", mask_file("m.npy", lambda path: np.save(path, np.zeros((12, 2, HEIGHT, WIDTH),
        bool))), "refused", "(12, 2, 96, 128); use one array"),
    Row("masks, one bit a pixel", masked([mask()] * 12, change=saved_by("1")), "right", "", half_excluded),
    Row("masks, grey and a full alpha channel", masked([mask()] * 12, change=saved_by("LA")), "right", "",
        half_excluded),
    Row("masks of twice the size", masked([np.kron(mask(), np.ones((2, 2), np.uint8))] * 12), "right", "",
        half_excluded),
    Row("masks, an unsure border", masked([np.where(np.roll(mask(), 6, 1) != mask(), 128,
        mask()).astype(np.uint8)] * 12), "refused", "this is not a mask"),
]  # fmt: skip
