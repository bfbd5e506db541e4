"""Rows of `inputs_tried.py` about depth: units, marks of no depth, files of other programs."""

from pathlib import Path

import cv2
import numpy as np
from builders import builder
from depth_folders import WRONG as NO_LENGTHS
from depth_folders import recording as with_depth
from depth_folders import true_depth
from input_kinds import each, of_all_frames, prepare, tiff, with_file
from input_rows import depth_is_true, refused, right, told
from made_videos import HEIGHT, WIDTH
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from scipy.io import savemat
from scipy.ndimage import zoom

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png


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
def marked(i: int, value):
    """True depth with this number where there is none."""
    plane = true_depth(i)
    plane[HOLE] = value
    return plane


def hole_is_empty(folder: Path) -> bool:
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
def in_one_file(folder: Path, name: str, save) -> list[str]:
    """Depth of a whole clip in one file; `save` gets the path and the array."""
    words = with_depth(folder, true_depth, "d", "npy")
    save(folder / name, np.stack([np.load(file) for file in sorted((folder / "d").iterdir())]))
    return [str(folder / name) if word == str(folder / "d") else word for word in words]


def with_no_data(path: Path, plane: np.ndarray) -> None:
    """Depth in TIFF whose tag states the number without a meaning."""
    tags = ImageFileDirectory_v2()
    tags[42113], tags.tagtype[42113] = "77", 2
    plane[HOLE] = 77
    Image.fromarray(plane.astype(np.float32)).save(path, tiffinfo=tags)


def in_mat(path: Path, plane: np.ndarray) -> None:
    savemat(path, {"depth": plane.astype(np.float32), "unit": "mm"}, do_compression=True)


def wide_tiff(path: Path, plane: np.ndarray, black_is_zero: int = 1) -> None:
    """Hundredths of a millimetre."""
    stored = np.round(plane * 100).astype(np.uint16)
    tiff(path, stored if black_is_zero else 65535 - stored, black_is_zero, 16)


def signed_tiff(path: Path, plane: np.ndarray) -> None:
    """Hundredths of a millimetre, and -1 where there is none."""
    stored = np.round(plane * 100).astype(np.int16)
    stored[HOLE] = -1
    tiff(path, stored.view(np.uint16), 1, 16, sign=2)


def soft(plane: np.ndarray) -> np.ndarray:
    """Depth with a hole, resized by two with linear interpolation."""
    plane = plane[::2, ::2].astype(np.float32)
    plane[10:30, 10:40] = 0
    return zoom(plane, 2, order=1)


@builder
def simulated(folder: Path, change) -> list[str]:
    """A simulated clip with its right view, whose depth is changed."""
    main(["simulate", "still", "--out", str(folder / "raw"), "--width", "192", "--height", "160", "--frames", "3"])
    each("depth", lambda plane: change(plane.astype(np.uint16)).astype(np.uint16))(folder / "raw")
    return prepare("raw", "--baseline", "4", camera=())(folder)


def arrays(change, *words: str):
    """True depth, changed, as an npy for each frame."""
    return depth_files(lambda path, plane: np.save(path, change(plane)), ".npy", *words)


DEPTH_ROWS = [
    right("depth, millimetres", depth(true_depth), depth_is_true),
    right("depth, metres, stated", depth(lambda i: true_depth(i) / 1e3, "--depth-unit", "m"), depth_is_true),
    *(refused(f"depth, {kind}", depth(values, name=name, kind=ending), said) for kind, (values, name, ending,
        said) in NO_LENGTHS.items()),
    refused("depth, of half the size", depth(lambda i: true_depth(i)[::2, ::2]), "depth of 64x48 pixels"),
    refused("depth, not a number", depth(lambda i: true_depth(i) * np.nan), "no value is finite"),
    *(right(f"depth, {value:g} where there is none", depth(marked(value)), hole_is_empty) for value in (np.nan, np.inf,
        -1.0)),
    refused("depth, 1e6 where there is none", depth(marked(1e6)), "mark pixels without depth"),
    refused("depth, 65535 where there is none", depth(lambda i: marked(65535)(i).astype(np.uint16), kind="png"),
        "mark pixels without depth"),
    right("depth, float TIFF", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.float32)).save(path),
        ".tiff"), depth_is_true),
    refused("depth, false colours", depth(coloured, kind="png"), "one grey channel expected"),
    right("depth, points x y z of SCARED", depth_files(points_of_scared, ".tiff"), depth_is_true),
    told("depth, one npz for the clip", in_one_file("clip.npz", lambda path, stack: np.savez(path, depths=stack)),
        "clip.npz: --pairing order", depth_is_true),
    told("depth, one npy for the clip", in_one_file("clip.npy", np.save), "clip.npy: --pairing order", depth_is_true),
    right("depth, one npz for each frame", depth_files(lambda path, plane: np.savez_compressed(path,
        depth=plane.astype(np.float32)), ".npz"), depth_is_true),
    right("depth, TIFF with a number that means none", depth_files(with_no_data, ".tif"), hole_is_empty),
    right("depth, one MAT-file for each frame", depth_files(in_mat, ".mat"), depth_is_true),
    refused("depth, several frames in a MAT-file", depth_files(lambda path, plane: in_mat(path, np.stack([plane] * 6,
        axis=2)), ".mat"), "one file of (height, width)"),
    refused("depth, half-float TIFF", depth_files(lambda path, plane: tiff(path, plane.astype("<f2").view("<u2"),
        sign=3), ".tiff"), "numbers of 16 or 64 bits"),
    refused("depth, EXR", depth_files(lambda path, plane: path.write_bytes(b"\x76\x2f\x31\x01" + bytes(60)), ".exr"),
        "OpenEXR is not read; convert it"),
    right("depth, grey with three channels", depth_files(lambda path, plane: write_png(path,
        np.repeat(plane.round().astype(np.uint8)[..., None], 3, axis=2)), ".png")),
    right("depth, steps stated", arrays(lambda plane: (plane * 256).astype(np.uint16), "--depth-scale", "0.00390625"),
        depth_is_true),
    refused("depth, negative", depth(lambda i: -true_depth(i)), "all values are negative"),
    told("depth, one frame marked -1 everywhere", depth(lambda i: true_depth(i) * 0 - 1 if i == 3 else true_depth(i)),
        "frames without any depth: 3"),
    told("depth, centimetres", depth(lambda i: true_depth(i) / 10), "if that is too near"),
    refused("depth, bytes exchanged", depth_files(lambda path, plane: write_png(path,
        np.round(plane * 100).astype(np.uint16).byteswap()), ".png", "--depth-scale", "0.01"),
        "two bytes of each number exchanged"),
    told("depth, one array in the order of names as text", of_all_frames(lambda k: true_depth(k).astype(np.float32),
        "--depth"), "10.png stands in the place of 2.png"),
    refused("depth, a far plane where there is none", depth(marked(150.0)), "have the depth 150 in every frame"),
    refused("depth, the least number of a network where there is none", depth(marked(1e-3)),
        "have the depth 0.001 in every frame"),
    refused("depth, TIFF of 16 bit in which 0 is white", depth_files(lambda path, plane: wide_tiff(path, plane, 0),
        ".tif", "--depth-scale", "0.01"), "states that 0 is white"),
    right("depth, TIFF of 16 bit", depth_files(wide_tiff, ".tif", "--depth-scale", "0.01"), depth_is_true),
    right("depth, TIFF of 16 bit with a sign and -1 where there is none", depth_files(signed_tiff, ".tif",
        "--depth-scale", "0.01"), hole_is_empty),
    refused("depth, one array with the frames last", in_one_file("clip.npy", lambda path, stack: np.save(path,
        stack.transpose(1, 2, 0))), "depth of 6x128 pixels"),
    refused("depth, one array beside its confidence", in_one_file("clip.npz", lambda path, stack: np.savez(path,
        depths=stack, confidence=np.ones_like(stack))), "holds depths (6, 96, 128), confidence"),
    told("depth, resized with interpolation across holes", arrays(soft), "blended-depth"),
    told("depth, 5000 steps a metre, with a right view", simulated(lambda z: 5 * z),
        "5000 steps a metre read as millimetres"),
    told("depth, 15 mm more, with a right view", simulated(lambda z: z + 15), "mm more than"),
    refused("depth, pt of each frame", depth_files(lambda path, plane: path.write_bytes(b"x"), ".pt"),
        'torch.load(f, "cpu", weights_only=True)'),
    refused("depth, mat of all frames", with_file("--depth", "d.mat", lambda path: savemat(path, {"z": np.ones((96, 128,
        6))})), '["z"], 2, 0))` if its last axis is that of the frames'),
    right("depth, batch and channel axes", arrays(lambda plane: plane[None, None]), depth_is_true),
    refused("depth, disparity, depth and confidence in one npz", depth_files(lambda path, plane: np.savez(path,
        disp=plane, depth=plane, conf=plane), ".npz"), "holds disp (96, 128), depth (96, 128), conf (96, 128)"),
    refused("depth, BMP", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.uint8)).save(path), ".bmp"),
        "it holds 6 files of the ending .bmp"),
]  # fmt: skip
