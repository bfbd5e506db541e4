"""Rows of `inputs_tried.py` about clips of capture cards and consoles, and files in each other's place."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from builders import builder
from depth_folders import true_depth
from input_kinds import (
    OPENCV,
    Row,
    calibrated,
    centred,
    folder_of,
    frames_changed,
    half_excluded,
    mask,
    masked,
    pair,
    prepare,
    public,
    video,
)
from made_videos import HEIGHT, WIDTH, files, picture, pictures
from scipy.ndimage import zoom
from still_text import FRAMES, tissue, with_text

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png

WIDE = ("--camera", "250", "250", "128", "96")
OTHER_ORDER = "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [-0.1, 0.01, {}]\n"


@builder
def of_tissue(folder: Path, change, *words: str) -> list[str]:
    """Pictures of moving tissue, changed."""
    files(folder, "clip", [change(tissue(i), i) for i in range(FRAMES)])
    return prepare("clip", *words, camera=WIDE)(folder)


def exchanged(frames: list) -> list:
    """Frames 6 and 7 in each other's place."""
    return [*frames[:6], frames[7], frames[6], *frames[8:]]


def slow(count: int = 16) -> list[np.ndarray]:
    return [picture(0.5 * i) for i in range(count)]


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


def soft_depth(folder: Path) -> list[str]:
    """True depth with a hole, resized by two with linear interpolation."""
    files(folder, "clip", pictures())
    (folder / "d").mkdir()
    for i in range(12):
        plane = true_depth(i)[::2, ::2].astype(np.float32)
        plane[10:30, 10:40] = 0
        np.save(folder / "d" / f"{i:04d}.npy", zoom(plane, 2, order=1).astype(np.float32))
    return [*prepare("clip")(folder), "--depth", str(folder / "d")]


@builder
def simulated(folder: Path, change, *words: str) -> list[str]:
    """A simulated clip with its right view, whose depth is changed."""
    size = ["--width", "192", "--height", "160", "--frames", "3"]
    main(["simulate", "still", "--out", str(folder / "raw"), *size])
    for file in (folder / "raw/depth").iterdir():
        write_png(file, change(read_png(file).astype(np.uint16)).astype(np.uint16))
    return prepare("raw", "--baseline", "4", *words, camera=())(folder)


def bars(shown: np.ndarray) -> np.ndarray:
    """The grey desktop of a console on both sides."""
    side = np.full((shown.shape[0], 60, 3), 90, np.uint8)
    return np.hstack([side, shown, side])


def of_the_masks_command(folder: Path) -> list[str]:
    """The folder that `endotsr masks` wrote, with its pictures, in place of the masks in it."""
    words = masked([mask()] * 12)(folder)
    (folder / "found").mkdir()
    (folder / "m").rename(folder / "found/masks")
    (folder / "found/proposal.json").write_text("{}")
    write_png(folder / "found/proposed_masks.png", pictures()[0])
    return [*words[: words.index("--masks") + 1], str(folder / "found")]


def with_inset(frame: np.ndarray, i: int) -> np.ndarray:
    """Another moment of the same tissue, small and brightened, in a corner."""
    found = frame.copy()
    found[:64, -80:] = 255 - tissue(FRAMES - 1 - i)[::3, ::3][:64, :80]
    return found


def blended(folder: Path) -> list[str]:
    shown = [tissue(i).astype(int) for i in range(FRAMES)]
    files(folder, "clip", [p.astype(np.uint8) for a, b in pairwise(shown) for p in (a, (a + b) // 2)])
    return prepare("clip", camera=WIDE)(folder)


def named_file(name: str):
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(bytes(99))
        return prepare(name)(folder)

    return make


SURGEON_ROWS = [
    Row("masks, the folder that endotsr masks wrote", of_the_masks_command, "right", "", half_excluded),
    Row("camera, numbers with commas", folder_of(pictures(), "--camera", "100,100,64,48"), "refused",
        "use a number, apart from the others: --camera 100 100 64 48"),
    *(Row(f"crop as {word}", folder_of(pictures(), "--crop", word), "refused", f"--crop '{word}' is not allowed; use an"
        f" integer, {how}") for word, how in (("100x80+10+12", "as X Y WIDTH HEIGHT: --crop 10 12 100 80"),
        ("crop=100:80:10:12", "as X Y WIDTH HEIGHT: --crop 10 12 100 80"), ("10:12:100:80", "as X Y WIDTH HEIGHT"),
        ("10,12,100,80", "apart from the others: --crop 10 12 100 80"))),
    Row("rate with a decimal comma", folder_of(pictures(), "--source-rate", "29,97"), "refused",
        "use a number, with a decimal point (29.97)"),
    Row("baseline with a unit", folder_of(pictures(), "--baseline", "4.2 mm"), "refused",
        "use a number, without a unit (4.2)"),
    Row("frames in words", folder_of(pictures(), "--frames", "first"), "refused", "'first': not a range"),
    Row("nerfstudio, paths of another machine", public("nerfstudio", change=frames_changed(
        file_path=lambda frame: f"/home/a/{frame['file_path']}")), "refused",
        "is an absolute path; write it from the folder of the file"),
    Row("calibration, CSV with semicolons", calibrated("K.csv", "100;0;63.5\n0;101;47.5\n0;0;1\n"), "told",
        "half a pixel", centred),
    Row("a path with backslashes", lambda folder: [w.replace("/clip", "\\clip") for w in folder_of(pictures())(folder)],
        "refused", "not found; write strokes in place of backslashes"),
    Row("a bag of ROS 2", named_file("a.db3"), "refused", "a ROS bag; export its pictures"),
    Row("a presentation", named_file("a.pptx"), "refused", "a presentation; export its pictures"),
    Row("pictures, another clip in a corner", of_tissue(with_inset), "told", "in the upper right corner"),
    Row("pictures, every second one blended", blended, "told", "every second picture is the mean of its neighbours"),
    Row("stereo, a right view that is dark", pair(frames=(pictures(), [p // 2 for p in pictures()])), "told",
        "unequal-views"),
    Row("pictures, text of a console", of_tissue(lambda shown, i: with_text(shown)), "told", "burnt-in"),
    Row("pictures, two recordings side by side", of_tissue(lambda shown, i: np.hstack([shown,
        255 - tissue(FRAMES - 1 - i)])), "told", "a straight border crosses the pictures at column"),
    Row("pictures, the grey desktop of a console beside them", of_tissue(lambda shown, i: bars(shown)), "told",
        "a straight border crosses the pictures at column"),
    Row("pictures, two of them exchanged", folder_of(exchanged(slow())), "told", "exchanged-frames"),
    Row("video, two pictures exchanged", video("a.mp4", exchanged(slow())), "told", "exchanged-frames"),
    Row("masks, mirrored", mirrored_masks(lambda mask: mask[:, ::-1]), "told", "flipped-masks"),
    Row("masks, not mirrored", mirrored_masks(lambda mask: mask), "right"),
    Row("depth, resized with interpolation across holes", soft_depth, "told", "blended-depth"),
    Row("depth, 5000 steps a metre, with a right view", simulated(lambda z: 5 * z), "told",
        "5000 steps a metre read as millimetres"),
    Row("depth, 15 mm more, with a right view", simulated(lambda z: z + 15), "told", "mm more than"),
    Row("calibration, k1 k2 k3 p1 p2", calibrated("a.yaml", OPENCV + OTHER_ORDER.format("-0.08, 0.0007, -0.0003")),
        "told", "if they are k1 k2 k3 p1 p2"),
    Row("camera, k1 k2 k3 p1 p2", folder_of(pictures(), "--distortion", "-0.1", "0.01", "-0.08", "0.001", "0.002"),
        "told", "if they are k1 k2 k3 p1 p2"),
]  # fmt: skip
