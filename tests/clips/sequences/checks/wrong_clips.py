"""Wrong inputs: what is done to the folder of a right clip, and the finding that names it."""

import numpy as np
from builders import builder

from endotsr.clips.opencv.png import read_png, write_png

FRAMES = 9


def each(folder, name, change, frames=range(FRAMES)):
    """Change the pictures of a folder."""
    for i in frames:
        file = folder / name / f"{i:06d}.png"
        write_png(file, change(read_png(file)))


def poses(folder, change):
    rows = np.load(folder / "poses_bounds.npy")
    change(rows)
    np.save(folder / "poses_bounds.npy", rows)


def drift(rows, step=1.0):
    rows[:, 3] = step * np.arange(len(rows))


def jump(rows):
    drift(rows)
    rows[5, 3] += 500


def turn(rows):
    rows[4, :15] = np.column_stack([np.diag([-1.0, 1.0, -1.0]), rows[4, :15].reshape(3, 5)[:, 3:]]).ravel()


def metres(depth):
    return (depth // 1000 + (depth > 0)).astype(np.uint8)


def normalised(depth):
    return (depth / depth.max() * 255).astype(np.uint8)


def exposure(image):
    return (image * 0.3).astype(np.uint8)


@builder
def entry(rows, row, column, value):
    rows[:, :15].reshape(-1, 3, 5)[:, row, column] = value


def copied(folder, a, b, names=("images",)):
    for name in names:
        (folder / name / f"{b:06d}.png").write_bytes((folder / name / f"{a:06d}.png").read_bytes())


def renamed(folder):
    for name in ("images", "masks", "depth"):
        for i in range(5, FRAMES):
            (folder / name / f"{i:06d}.png").rename(folder / name / f"{i + 20:06d}.png")


HELD_OUT = range(1, FRAMES, 8)
TRAINING = sorted(set(range(FRAMES)) - set(HELD_OUT))

# Name -> (damage, code of the finding, level, frame)
WRONG = {
    "no masks folder": (lambda p: (p / "masks").rename(p / "m"), "masks-files", "refusal", None),
    "no depth folder": (lambda p: (p / "depth").rename(p / "d"), "depth-files", "refusal", None),
    "no images": (lambda p: (p / "images").rename(p / "i"), "images-files", "refusal", None),
    "image without mask": (lambda p: (p / "masks/000003.png").unlink(), "pairing", "refusal", None),
    "image without depth": (lambda p: (p / "depth/000003.png").unlink(), "pairing", "refusal", None),
    "truncated image": (lambda p: cut(p / "images/000003.png"), "picture", "refusal", 3),
    "truncated mask": (lambda p: cut(p / "masks/000003.png"), "mask", "refusal", 3),
    "truncated depth": (lambda p: cut(p / "depth/000003.png"), "depth-file", "refusal", 3),
    "image of another size": (lambda p: each(p, "images", lambda x: x[:40], [3]), "size", "refusal", 3),
    "mask of another size": (lambda p: each(p, "masks", lambda x: x[:40], [3]), "size", "refusal", 3),
    "depth of another size": (lambda p: each(p, "depth", lambda x: x[:40], [3]), "size", "refusal", 3),
    "soft mask": (lambda p: each(p, "masks", lambda x: x // 2 + 40, [3]), "mask-values", "refusal", 3),
    "polarity": (lambda p: each(p, "masks", lambda x: 255 - x), "polarity", "refusal", None),
    "one mask inverted": (lambda p: each(p, "masks", lambda x: 255 - x, [4]), "single-mask", "refusal", None),
    "one mask over everything": (lambda p: each(p, "masks", lambda x: x * 0 + 255, [4]), "frame-without-tissue",
                                 "warning", 4),
    "held-out frames without tissue": (lambda p: each(p, "masks", lambda x: x * 0 + 255, HELD_OUT),
                                       "nothing-to-evaluate", "warning", None),
    "training frames without depth": (lambda p: each(p, "depth", lambda x: x * 0, TRAINING), "nothing-to-train",
                                      "refusal", None),
    "one mask with a hole": (lambda p: each(p, "masks", holed, [4]), "unlike-mask", "warning", 4),
    "masks of noise": (lambda p: each(p, "masks", noisy), "speckled-masks", "warning", None),
    "masks upside down": (lambda p: upside_down(p), "flipped-masks", "warning", None),
    "brightness grows with depth": (lambda p: (each(p, "depth", sloped), each(p, "images",
        lambda image: (image * np.linspace(0.3, 1, len(image))[:, None, None]).astype(np.uint8))),
        "depth-against-light", "warning", None),
    "one depth upside down": (lambda p: (each(p, "depth", sloped), each(p, "depth", lambda x: x[::-1], [4])),
                              "flipped-depth", "warning", 4),
    "masks empty": (lambda p: each(p, "masks", lambda x: x * 0), "tissue-fraction", "refusal", None),
    "masks full": (lambda p: each(p, "masks", lambda x: x * 0 + 255), "tissue-fraction", "refusal", None),
    "numbers with a gap": (renamed, "number-gap", "warning", 5),
    "duplicated frame": (lambda p: copied(p, 3, 4), "duplicated-frame", "warning", 4),
    "a frame that returns": (lambda p: copied(p, 2, 6), "returning-frames", "warning", 6),
    "one picture without its colours": (lambda p: each(p, "images", lambda image: np.repeat(image[:, :, 1:2], 3, 2),
        [4]), "colour-jump", "warning", 4),
    "another light": (lambda p: each(p, "images", lambda image: (image * [0.6, 1.0, 1.0]).astype(np.uint8), range(4,
        FRAMES)), "colour-jump", "warning", 4),
    "a picture that was not decoded to its end": (lambda p: each(p, "images", half_decoded, [3]), "plain-frame",
                                                  "warning", 3),
    "masks of two polarities": (lambda p: each(p, "masks", lambda x: 255 - x, range(4, FRAMES)), "turned-masks",
                                "warning", 4),
    "a pose that stays": (lambda p: poses(p, stays), "repeated-pose", "note", 3),
    "black frame": (lambda p: each(p, "images", lambda x: x * 0, [3]), "black-frame", "warning", 3),
    "white frame": (lambda p: each(p, "images", lambda x: x * 0 + 255, [3]), "white-frame", "warning", 3),
    "black clip": (lambda p: each(p, "images", lambda x: x * 0), "no-picture", "refusal", 0),
    "mostly white": (lambda p: each(p, "images", lambda x: x * 0 + 255, range(2, 8)), "no-picture", "refusal", 2),
    "one colour": (lambda p: each(p, "images", lambda x: x * 0 + np.uint8(90)), "no-picture", "refusal", 0),
    "frozen": (lambda p: [copied(p, 0, i) for i in range(1, FRAMES)], "constant-clip", "refusal", 0),
    "woven of two moments": (lambda p: each(p, "images", combed), "interlaced-pictures", "warning", None),
    "woven by columns": (lambda p: each(p, "images", combed_across), "interlaced-pictures", "warning", None),
    "overexposed": (lambda p: each(p, "images", half_white, [3]), "clipped-frame", "warning", 3),
    "exposure jump": (lambda p: each(p, "images", exposure, range(4, FRAMES)), "exposure-jump", "warning", 4),
    "metres cut to 8 bits": (lambda p: each(p, "depth", metres), "metres-cut", "refusal", None),
    "times 256": (lambda p: each(p, "depth", lambda x: (x * 256).astype(np.uint16)), "depth-unit", "warning", None),
    "micrometres": (lambda p: each(p, "depth", lambda x: (x * 1000).clip(0, 65535)), "depth-unit", "warning", None),
    "normalised": (lambda p: each(p, "depth", normalised), "normalised-depth", "warning", None),
    "depth of another scale in each frame": (lambda p: [each(p, "depth", lambda x, i=i: rescaled(x, i), [i])
                                                        for i in range(FRAMES)], "depth-own-scale", "warning", None),
    "constant depth": (lambda p: each(p, "depth", lambda x: (x > 0) * np.uint8(60)), "constant-depth", "refusal", None),
    "coarse depth": (lambda p: each(p, "depth", lambda x: (x // 10) * 10), "coarse-depth", "warning", None),
    "no depth at all": (lambda p: each(p, "depth", lambda x: x * 0), "no-depth", "refusal", None),
    "little depth": (lambda p: each(p, "depth", corner), "little-depth", "warning", None),
    "one frame without depth": (lambda p: each(p, "depth", lambda x: x * 0, [3]), "frame-without-depth", "note", 3),
    "one frame far off": (lambda p: each(p, "depth", lambda x: x * 10, [3]), "depth-far-off", "warning", 3),
    "no poses": (lambda p: (p / "poses_bounds.npy").unlink(), "cameras", "refusal", None),
    "a pose too few": (lambda p: np.save(p / "poses_bounds.npy", np.load(p / "poses_bounds.npy")[1:]), "cameras",
                       "refusal", None),
    "no number": (lambda p: poses(p, entry(0, 3, np.nan)), "cameras", "refusal", None),
    "no rotation": (lambda p: poses(p, entry(0, 0, 2.0)), "cameras", "refusal", None),
    "size swapped": (lambda p: poses(p, entry(0, 4, 64.0)), "cameras", "refusal", None),
    "pose jump": (lambda p: poses(p, jump), "pose-jump", "warning", 5),
    "pose turn": (lambda p: poses(p, turn), "pose-turn", "warning", 4),
    "poses in metres": (lambda p: poses(p, lambda r: drift(r, 1e-4 / 8)), "pose-unit", "warning", None),
    "poses in micrometres": (lambda p: poses(p, lambda r: drift(r, 1e3)), "pose-unit", "warning", None),
    "negatives": (lambda p: each(p, "images", lambda x: 255 - x), "negative-pictures", "warning", None),
    "red and blue exchanged": (lambda p: each(p, "images", lambda x: x[:, :, ::-1]), "blue-pictures", "warning", None),
    "two views in turn": (lambda p: each(p, "images", lambda x: np.roll(x, 20, 1), range(1, FRAMES, 2)),
                          "alternating-views", "warning", None),
    "65535 without depth": (lambda p: each(p, "depth", without), "marked-depth", "warning", None),
    "tenths of millimetres in 8 bits": (lambda p: each(p, "depth", tenths), "wrapped-depth", "warning", None),
    "far away": (lambda p: poses(p, entry(0, 3, 1e9)), "far-from-origin", "note", None),
    "focal length in mm": (lambda p: poses(p, entry(2, 4, 4.0)), "field-of-view", "warning", None),
    "grey image": (lambda p: each(p, "images", lambda x: x[:, :, 0], [3]), "picture", "refusal", 3),
    "16-bit image": (lambda p: each(p, "images", lambda x: x.astype(np.uint16) * 257, [3]), "picture", "refusal", 3),
    "coloured mask": (lambda p: each(p, "masks", coloured, [3]), "mask", "refusal", 3),
    "empty file": (lambda p: (p / "images/000003.png").write_bytes(b""), "picture", "refusal", 3),
    "two files of one number": (lambda p: copied_as(p / "images", "000003.png", "3.png"), "images-files", "refusal",
                                None),
    "a stray picture": (lambda p: copied_as(p / "images", "000003.png", "overview.png"), "images-files", "refusal",
                        None),
    "all grey": (lambda p: each(p, "images", lambda x: np.repeat(x[:, :, :1], 3, 2)), "grey-pictures", "note", None),
    "centimetres": (lambda p: each(p, "depth", lambda x: (x // 10 + (x > 0)).astype(np.uint8)), "coarse-depth",
                    "warning", None),
    "mirrored pose": (lambda p: poses(p, mirrored), "cameras", "refusal", None),
    "two frames": (lambda p: keep(p, 2), "frames", "refusal", None),
}  # fmt: skip


def cut(file):
    file.write_bytes(file.read_bytes()[:-20])


def noisy(mask):
    return np.where(np.random.default_rng(0).random(mask.shape) < 0.05, 255 - mask, mask)


def upside_down(folder):
    """Grey instruments in the upper half on red tissue, and masks that exclude the lower half."""
    for i in range(FRAMES):
        image, mask = (folder / name / f"{i:06d}.png" for name in ("images", "masks"))
        excluded = np.zeros_like(read_png(mask))
        excluded[2 : 12 + i, 20:44] = 255
        red = (read_png(image) * np.array([1.0, 0.5, 0.5])).astype(np.uint8)
        write_png(image, np.where(excluded[..., None] > 0, np.uint8(120), red))
        write_png(mask, excluded[::-1])


def rescaled(depth, i):
    """Hundredths of a millimetre, times a factor of the frame."""
    factor = np.exp(np.random.default_rng(i).normal(0, 0.1))
    return (100.0 * depth * factor).astype(np.uint16)


def sloped(depth):
    """Depth that increases to the lower border."""
    return np.where(depth > 0, 40 + np.arange(len(depth))[:, None] // 2, 0).astype(depth.dtype)


def tenths(depth):
    """Fine depth of a slope, in tenths of millimetres, of which a byte keeps the remainder of 256."""
    y, x = np.indices(depth.shape[:2])
    return np.where(depth > 0, (400 + 3 * x + 4 * y) % 256, 0).astype(np.uint8)


def without(depth):
    return np.where(np.arange(depth.shape[1]) < 4, 65535, depth).astype(np.uint16)


def combed(image):
    image[1::2] = np.roll(image[1::2], 6, 1)
    return image


def combed_across(image):
    image[:, 1::2] = np.roll(image[:, 1::2], 6, 0)
    return image


def holed(mask):
    """Another 13 % of the pixels excluded, as where stereo matching fails. Masks two apart differ in 7 %."""
    mask[4:24, 25:45] = 255
    return mask


def half_decoded(image):
    image[len(image) // 2 :] = 128
    return image


def stays(rows):
    drift(rows)
    rows[3:7, 3] = rows[3, 3]


def coloured(mask):
    return np.stack([mask, mask, mask // 2], axis=2)


def copied_as(folder, name, other):
    (folder / other).write_bytes((folder / name).read_bytes())


def mirrored(rows):
    rows[:, :15].reshape(-1, 3, 5)[:, :, 0] *= -1


def half_white(image):
    image[: len(image) // 2] = 255
    return image


def corner(depth):
    result = depth * 0
    result[30:36, 30:50] = depth[30:36, 30:50]
    return result


def keep(folder, count):
    for name in ("images", "masks", "depth"):
        for file in sorted((folder / name).iterdir())[count:]:
            file.unlink()
    np.save(folder / "poses_bounds.npy", np.load(folder / "poses_bounds.npy")[:count])
