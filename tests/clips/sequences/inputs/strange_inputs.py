"""Rows of `inputs_tried.py` about numbers of another scale, exchanged numbers, and one moment in the place of all."""

from pathlib import Path

import numpy as np
from builders import builder
from depth_folders import true_depth
from input_kinds import CAMERA, Row, common, depth_files, folder_of, named, pair, prepare
from made_videos import HEIGHT, WIDTH, files, picture, pictures, write

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


def exchanged_bytes(path: Path, plane: np.ndarray) -> None:
    """Hundredths of a millimetre, low byte first, as a writer leaves them that copies its memory."""
    write_png(path, np.round(plane * 100).astype(np.uint16).byteswap())


@builder
def lens(folder: Path, *words: str, size=(WIDTH, HEIGHT), camera=CAMERA) -> list[str]:
    """Pictures of this size with a camera, and further words."""
    files(folder, "clip", [picture(i, *size) for i in range(12)])
    return prepare("clip", *words, camera=camera)(folder)


def prepared(folder: Path, *words: str) -> Path:
    """A folder in the common format without masks and depth."""
    main(folder_of(red_and_grey(), *words)(folder))
    return folder / "o"


def red_and_grey() -> list[np.ndarray]:
    """Red tissue with a grey instrument in the middle."""
    found = pictures()
    for shown in found:
        shown[20:60, 40:80] = shown[20:60, 40:80].mean(axis=2, keepdims=True)
    return found


@builder
def keys(folder: Path, value_inside: int, value_outside: int, *words: str) -> list[str]:
    """Masks of two key frames with these numbers on the instrument and beside it."""
    clip = prepared(folder)
    plane = np.full((HEIGHT, WIDTH), value_outside, np.uint8)
    plane[20:60, 40:80] = value_inside
    (folder / "k").mkdir()
    for i in (0, 6):
        write_png(folder / "k" / f"{i:06d}.png", plane)
    return ["masks", str(clip), "--keys", str(folder / "k"), *words]


@builder
def given(folder: Path, factor: float) -> list[str]:
    """True depth times a factor, as files for `endotsr depth`."""
    clip = prepared(folder)
    files(folder, "d", [(factor * true_depth(i)).astype(np.float32) for i in range(12)], "npy")
    return ["depth", str(clip), "--given", str(folder / "d"), "--kind", "depth"]


def textured(i: int, shift: int = 0, down: int = 0) -> np.ndarray:
    """A picture of 256x192 whose texture moves."""
    rough = np.random.default_rng(1).integers(0, 255, (60, 100)).astype(np.uint8)
    whole = np.kron(rough, np.ones((4, 4)))[20 + down : 212 + down, 40 + shift + 4 * i : 296 + shift + 4 * i]
    return np.stack([whole, whole / 2, whole / 2], axis=2).astype(np.uint8)


@builder
def matched(folder: Path, right) -> list[str]:
    """`endotsr depth` on a pair of cameras whose right view is made by a function of the number of the frame."""
    shown = [textured(i) for i in range(4)], [right(i) for i in range(4)]
    main(pair(frames=shown)(folder))
    return ["depth", str(folder / "o")]


def videos_in_a_folder(folder: Path) -> list[str]:
    (folder / "clip").mkdir()
    for name in ("part 1.mp4", "part 2.mp4"):
        write(folder / "clip" / name, pictures(4))
    return prepare("clip")(folder)


def one_plane(clip: Path) -> None:
    """The depth of the first frame in the place of all."""
    first = read_png(clip / "depth/000000.png")
    for file in (clip / "depth").iterdir():
        write_png(file, first)


MILLISECONDS = [40.0 * i for i in range(5)]
STRANGE_ROWS = [
    Row("camera, cx and cy exchanged", lens(size=(160, 128), camera=("--camera", "142", "142", "64", "80")), "told",
        "near the centre with cx and cy exchanged"),
    Row("camera, distortion of another lens", lens("--distortion", "-0.9", "0", "0", "0"), "told",
        "turns back inside the picture"),
    Row("camera, one with a baseline", folder_of(pictures(), "--baseline", "4"), "told", "next: endotsr poses",
        lambda folder: read_sequence_file(folder / "o").camera.baseline == 4),
    Row("depth, bytes exchanged", depth_files(exchanged_bytes, ".png", "--depth-scale", "0.01"), "refused",
        "two bytes of each number exchanged"),
    Row("depth, of one frame for all, check", common(change=one_plane), "told", "the depth of 5 frames is that of 1"),
    Row("depth, a plane once in millimetres times 100, given", given(100), "told", "the median depth is 5"),
    Row("stereo, a right view from 8 rows lower", matched(lambda i: textured(i, 12, 8)), "told",
        "are the views rectified"),
    Row("stereo, a right view from 2 rows lower", matched(lambda i: textured(i, 12, 2)), "told", "unrectified-views"),
    Row("stereo, a right view that stands still", matched(lambda i: textured(0, 12)), "told", "frozen-right-view"),
    Row("stereo, a right view that is mirrored", matched(lambda i: textured(i, 12)[:, ::-1].copy()), "told",
        "are the views rectified"),
    Row("keys, white everywhere", keys(255, 255), "refused", "leave hardly any tissue in all 12 frames"),
    Row("keys, a margin wider than the picture", keys(255, 0, "--margin", "500"), "refused", "a smaller --margin"),
    Row("keys, inverted", keys(0, 255), "told", "seem to be inverted"),
    Row("times in milliseconds, check", common(times=MILLISECONDS), "told", "0.025 frames a second, 40 s between two"),
    Row("a time in the place of the rate, check", common(frame_rate=0.04), "told", "0.04 frames a second"),
    Row("a rate in microseconds, check", common(frame_rate=40000.0), "told", "4e+04 frames a second"),
    Row("common format, another number of frames, check", common(frames=6), "refused", "correct the key"),
    Row("a folder of videos", videos_in_a_folder, "refused", "it holds part 1.mp4, part 2.mp4; give the video itself"),
    Row("a video of another format", lambda folder: ((folder / "a.y4m").write_text("YUV4MPEG2 W128 H96 F25:1\n"),
        prepare("a.y4m")(folder))[1], "refused", "a video in a format that is not read; convert it to mp4"),
    Row("pictures, names of a browser", named(lambda k: f"{k}.jfif"), "refused", "let their names end in .jpg"),
    Row("frames to drop beyond the end", folder_of(pictures(), "--drop", "99"), "refused",
        "--drop '99': 99 is outside"),
]  # fmt: skip
