"""Rows of `inputs_tried.py` about depth: units, marks of no depth, files of other programs."""

from pathlib import Path

import cv2
import numpy as np
from builders import builder
from depth_folders import WRONG as NO_LENGTHS
from depth_folders import recording as with_depth
from depth_folders import true_depth
from input_kinds import Row, depth_is_true, folder_of, of_all_frames, prepare, tiff
from made_videos import HEIGHT, WIDTH, files, pictures
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from scipy.io import savemat
from scipy.ndimage import zoom

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


@builder
def depth(folder: Path, values, *words, name="depth", kind="npy") -> list[str]:
    return [*with_depth(folder, values, name, kind), *words]


@builder
def depth_files(folder: Path, save, ending: str, *words: str) -> list[str]:
    """True depth in files of another kind; `save` gets the path and the plane of a frame."""
    found = with_depth(folder, true_depth)
    for i, file in enumerate(sorted((folder / "depth").iterdir())):
        file.unlink()
        save(file.with_suffix(ending), true_depth(i))
    return [*found, *words]


HOLE = (slice(0, 20), slice(0, 30))  # of the depth


@builder
def marked(i: int, value, part=HOLE):
    """True depth with this number where there is none."""
    plane = true_depth(i)
    plane[part] = value
    return plane


def hole_is_empty(folder: Path) -> bool:
    from endotsr.clips.opencv.png import read_png

    plane = read_png(folder / "o/depth/000002.png")
    return not plane[HOLE].any() and bool((plane[:, 30:] > 0).all())


def coloured(i: int):
    """A picture of depth in false colours."""
    near = np.clip(4 * (true_depth(i) - 40), 0, 255).astype(np.uint8)
    return np.stack([near, 255 - near, near // 2], axis=2)


def points_of_scared(path: Path, z: np.ndarray) -> None:
    """Depth as SCARED stores it: x y z in float32, NaN without depth."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    points = np.stack([(u - 63.5) / 100 * z, (v - 47.5) / 100 * z, z], axis=2).astype(np.float32)
    cv2.imwrite(str(path), points[..., ::-1])


@builder
def in_one_file(folder: Path, ending: str) -> list[str]:
    """Depth of a whole clip as one array."""
    words = with_depth(folder, true_depth, "d", "npy")
    stack = np.stack([np.load(file) for file in sorted((folder / "d").iterdir())])
    file = folder / f"clip{ending}"
    np.savez(file, depths=stack) if ending == ".npz" else np.save(file, stack)
    return [str(file) if word == str(folder / "d") else word for word in words]


def with_no_data(path: Path, plane: np.ndarray) -> None:
    """Depth in TIFF whose tag states the number without a meaning."""
    tags = ImageFileDirectory_v2()
    tags[42113], tags.tagtype[42113] = "77", 2
    plane = plane.astype(np.float32)
    plane[:20, :30] = 77
    Image.fromarray(plane).save(path, tiffinfo=tags)


def corner_is_empty(folder: Path) -> bool:
    seen = read_png(folder / "o/depth/000002.png")
    return bool((seen[:19, :29] == 0).all() and (seen > 0).mean() > 0.9)


def depth_in_mat(frames: int = 1):
    """MAT-files of so many frames each."""

    def save(path: Path, plane: np.ndarray) -> None:
        stored = plane if frames == 1 else np.stack([plane] * frames, axis=2)
        savemat(path, {"depth": stored.astype(np.float32), "unit": "mm"}, do_compression=True)

    return depth_files(save, ".mat")


def exr(path: Path, plane) -> None:
    path.write_bytes(b"\x76\x2f\x31\x01" + bytes(60))


def npy(kind):
    return lambda path, plane: np.save(path, plane.astype(kind))


def exchanged_bytes(path: Path, plane: np.ndarray) -> None:
    """Hundredths of a millimetre, low byte first, as a writer leaves them that copies its memory."""
    write_png(path, np.round(plane * 100).astype(np.uint16).byteswap())


def wide_tiff(path: Path, plane: np.ndarray, black_is_zero: int = 1) -> None:
    """Hundredths of a millimetre."""
    stored = np.round(plane * 100).astype(np.uint16)
    tiff(path, stored if black_is_zero else 65535 - stored, black_is_zero, 16)


def signed_tiff(path: Path, plane: np.ndarray) -> None:
    """Hundredths of a millimetre, and -1 in a corner."""
    stored = np.round(plane * 100).astype(np.int16)
    stored[:20, :30] = -1
    tiff(path, stored.view(np.uint16), 1, 16, sign=2)


def frames_last(folder: Path) -> list[str]:
    words = in_one_file(".npy")(folder)
    np.save(folder / "clip.npy", np.load(folder / "clip.npy").transpose(1, 2, 0))
    return words


def with_confidence(folder: Path) -> list[str]:
    words = in_one_file(".npz")(folder)
    planes = np.load(folder / "clip.npz")["depths"]
    np.savez(folder / "clip.npz", depths=planes, confidence=np.ones_like(planes))
    return words


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


@builder
def depth_file(folder: Path, name: str, save) -> list[str]:
    """All depth in one file."""
    save(folder / name)
    return [*folder_of(pictures())(folder), "--depth", str(folder / name)]


def far_values(plane: np.ndarray) -> np.ndarray:
    """Depth of a renderer: nothing is at infinity, and a lost pixel is not a number."""
    plane = plane.astype(np.float32)
    plane[:4], plane[:, :4] = np.inf, np.nan
    return plane


def depth_is_true_inside(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    found = read_png(folder / "o/depth/000002.png") * (entry.scale if entry else 0)
    return bool(np.abs(found - true_depth(2))[4:, 4:].max() < 0.03 and not found[:4].any() and not found[:, :4].any())


DEPTH_ROWS = [
    Row("depth, millimetres", depth(true_depth), "right", "", depth_is_true),
    Row("depth, metres, stated", depth(lambda i: true_depth(i) / 1e3, "--depth-unit", "m"), "right", "", depth_is_true),
    *(Row(f"depth, {kind}", depth(values, name=name, kind=ending), "refused", said) for kind, (values, name, ending,
        said) in NO_LENGTHS.items()),
    Row("depth, of half the size", depth(lambda i: true_depth(i)[::2, ::2]), "refused", "depth of 64x48 pixels"),
    Row("depth, not a number", depth(lambda i: true_depth(i) * np.nan), "refused", "no value is finite"),
    *(Row(f"depth, {value:g} where there is none", depth(marked(value)), "right", "",
        hole_is_empty) for value in (np.nan, np.inf, -1.0)),
    Row("depth, 1e6 where there is none", depth(marked(1e6)), "refused", "mark pixels without depth"),
    Row("depth, 65535 where there is none", depth(lambda i: marked(65535)(i).astype(np.uint16), kind="png"), "refused",
        "mark pixels without depth"),
    Row("depth, float TIFF", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.float32)).save(path),
        ".tiff"), "right", "", depth_is_true),
    Row("depth, false colours", depth(coloured, kind="png"), "refused", "one grey channel expected"),
    Row("depth, points x y z of SCARED", depth_files(points_of_scared, ".tiff"), "right", "", depth_is_true),
    Row("depth, one npz for the clip", in_one_file(".npz"), "told", "clip.npz: --pairing order", depth_is_true),
    Row("depth, one npy for the clip", in_one_file(".npy"), "told", "clip.npy: --pairing order", depth_is_true),
    Row("depth, one npz for each frame", depth_files(lambda path, plane: np.savez_compressed(path,
        depth=plane.astype(np.float32)), ".npz"), "right", "", depth_is_true),
    Row("depth, TIFF with a number that means none", depth_files(with_no_data, ".tif"), "right", "", corner_is_empty),
    Row("depth, one MAT-file for each frame", depth_in_mat(), "right", "", depth_is_true),
    Row("depth, several frames in a MAT-file", depth_in_mat(frames=6), "refused", "one file of (height, width)"),
    Row("depth, half-float TIFF", depth_files(lambda path, plane: tiff(path, plane.astype("<f2").view("<u2"), sign=3),
        ".tiff"), "refused", "numbers of 16 or 64 bits"),
    Row("depth, EXR", depth_files(exr, ".exr"), "refused", "OpenEXR is not read; convert it"),
    Row("depth, half-float npy", depth_files(npy(np.float16), ".npy"), "right", ""),
    Row("depth, int32 npy", depth_files(npy(np.int32), ".npy"), "right", ""),
    Row("depth, grey with three channels", depth_files(lambda path, plane: write_png(path,
        np.repeat(plane.round().astype(np.uint8)[..., None], 3, axis=2)), ".png"), "right", ""),
    Row("depth, steps stated", depth_files(lambda path, plane: np.save(path, (plane * 256).astype(np.uint16)), ".npy",
        "--depth-scale", "0.00390625"), "right", "", depth_is_true),
    Row("depth, negative", depth(lambda i: -true_depth(i)), "refused", "all values are negative"),
    Row("depth, one frame marked -1 everywhere", depth(lambda i: true_depth(i) * 0 - 1 if i == 3 else true_depth(i)),
        "told", "frames without any depth: 3"),
    Row("depth, centimetres", depth(lambda i: true_depth(i) / 10), "told", "if that is too near"),
    Row("depth, bytes exchanged", depth_files(exchanged_bytes, ".png", "--depth-scale", "0.01"), "refused",
        "two bytes of each number exchanged"),
    Row("depth, one array in the order of names as text", of_all_frames(lambda k: true_depth(k).astype(np.float32),
        "--depth"), "told", "10.png stands in the place of 2.png"),
    Row("depth, a far plane where there is none", depth(marked(150.0)), "refused", "have the depth 150 in every frame"),
    Row("depth, the least number of a network where there is none", depth(marked(1e-3)), "refused",
        "have the depth 0.001 in every frame"),
    Row("depth, TIFF of 16 bit in which 0 is white", depth_files(lambda path, plane: wide_tiff(path, plane, 0), ".tif",
        "--depth-scale", "0.01"), "refused", "states that 0 is white"),
    Row("depth, TIFF of 16 bit", depth_files(wide_tiff, ".tif", "--depth-scale", "0.01"), "right", "", depth_is_true),
    Row("depth, TIFF of 16 bit with a sign and -1 where there is none", depth_files(signed_tiff, ".tif",
        "--depth-scale", "0.01"), "right", "", corner_is_empty),
    Row("depth, log of millimetres", depth(lambda i: np.log(true_depth(i))), "refused", "the median depth is 3.977"),
    Row("depth, one array with the frames last", frames_last, "refused", "depth of 6x128 pixels"),
    Row("depth, one array beside its confidence", with_confidence, "refused", "holds depths (6, 96, 128), confidence"),
    Row("depth, resized with interpolation across holes", soft_depth, "told", "blended-depth"),
    Row("depth, 5000 steps a metre, with a right view", simulated(lambda z: 5 * z), "told",
        "5000 steps a metre read as millimetres"),
    Row("depth, 15 mm more, with a right view", simulated(lambda z: z + 15), "told", "mm more than"),
    Row("depth, pt of each frame", depth_files(lambda path, plane: path.write_bytes(b"x"), ".pt"), "refused",
        'torch.load(f, "cpu", weights_only=True)'),
    Row("depth, mat of all frames", depth_file("d.mat", lambda path: savemat(path, {"z": np.ones((96, 128, 6))})),
        "refused", '["z"], 2, 0))` if its last axis is that of the frames'),
    Row("depth, batch and channel axes", depth_files(lambda path, plane: np.save(path, plane[None, None]), ".npy"),
        "right", "", depth_is_true),
    Row("depth, infinite background and lost pixels", depth_files(lambda path, plane: np.save(path, far_values(plane)),
        ".npy"), "right", "", depth_is_true_inside),
    Row("depth, disparity, depth and confidence in one npz", depth_files(lambda path, plane: np.savez(path, disp=plane,
        depth=plane, conf=plane), ".npz"), "refused", "holds disp (96, 128), depth (96, 128), conf (96, 128)"),
    Row("depth, padded to a square", depth(lambda i: np.pad(true_depth(i), ((16, 16), (0, 0)))), "refused",
        "depth of 128x128 pixels"),
    Row("depth, BMP", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.uint8)).save(path), ".bmp"),
        "refused", "it holds 6 files of the ending .bmp"),
]  # fmt: skip
