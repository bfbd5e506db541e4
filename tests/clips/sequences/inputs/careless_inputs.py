"""Rows of `inputs_tried.py` about folders of a careless user: labels as masks, lists and models in two forms."""

from pathlib import Path

import numpy as np
import public_layouts
import raw_sources
from builders import builder
from input_kinds import Row, calibrated, colmap, common, each, half_excluded, mask, masked, public, raw, trajectory
from made_videos import HEIGHT, WIDTH

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.sequence_file import read_sequence_file

KITTI = "".join(f"P{k}: 100 0 63.5 {b} 0 100 47.5 0 0 0 1 0\n" for k, b in enumerate((0, -40, 10, -30)))


def labels(small: int) -> np.ndarray:
    """Object 2 in the left columns, and a square of object 1."""
    plane = mask(2)
    plane[:small, 60 : 60 + small] = 1
    return plane


def small_label(plane: np.ndarray) -> np.ndarray:
    """A mask in which two objects have the numbers 1 and 2, on few pixels."""
    found = np.zeros_like(plane)
    found[:4, :4], found[8:12, :4] = 2, 1
    return found


@builder
def scaled_depth(folder: Path, factor: float) -> bool:
    """The depth that was written is the true one times a factor."""
    entry = read_sequence_file(folder / "o").depth
    found = read_png(folder / "o/depth/000002.png") * entry.scale
    return bool(np.abs(found - factor * public_layouts.depth(2)).max() < 1.0)


def in_both_forms(raw: Path) -> None:
    """The binary cameras, and no images.txt."""
    raw_sources.colmap(raw.parent / "b", True, 6)
    for name in ("cameras.bin", "images.bin", "points3D.bin"):
        (raw.parent / "b/sparse/0" / name).rename(raw / "sparse/0" / name)
    (raw / "sparse/0/images.txt").unlink()


def with_associations(folder: Path) -> None:
    (folder / "associations.txt").write_text("100.0 rgb/0.png 100.043 depth/1.png\n")


def three_labels() -> np.ndarray:
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    for k in range(3):
        plane[:, 30 * k : 30 * k + 30] = k + 1
    return plane


# Poses of four of twelve frames, as the key frames of ORB-SLAM.
KEY_FRAMES = [f"{k / 25:.6f} {k / 1000} 0 0 0 0 0 1" for k in (0, 3, 7, 11)]
CARELESS_ROWS = [
    Row("masks, numbers of objects, one of them small", masked([labels(4)] * 12), "refused",
        "nonzero the numbers of several objects"),
    Row("masks, numbers of objects, one of them small, stated", masked([labels(0)] * 12, "--excluded-value", "nonzero"),
        "right", "", half_excluded),
    Row("masks, numbers of three objects", masked([three_labels()] * 12), "refused",
        "nonzero the numbers of several objects"),
    Row("common format, a small object of another number in the masks", common(change=each("masks", small_label)),
        "refused", "numbers up to 2"),
    Row("nerfstudio, applied_scale and depth", public("nerfstudio", "--trajectory-unit", "m", applied_scale=0.5),
        "told", "applied_scale: depth files and points are multiplied by 0.5", scaled_depth(0.5)),
    Row("nerfstudio, without applied_scale", public("nerfstudio", "--trajectory-unit", "m"), "right", "",
        scaled_depth(1.0)),
    Row("COLMAP, images in the binary form alone", colmap(change=in_both_forms), "refused",
        "images.txt: file not found"),
    Row("TUM, associations", raw(raw_sources.tum, change=with_associations,
        camera=("--camera", "60", "61", "30", "25")), "told",
        "associations.txt: not read; pictures, depth and poses are paired by their times"),
    Row("KITTI, image_2 and image_3", calibrated("calib.txt", KITTI, folders=("image_2", "image_3")), "told",
        "P0 and P1 are read"),
    Row("trajectory of key frames", trajectory(KEY_FRAMES, "--source-rate", "25"), "refused",
        "8 of 12 frames have no pose"),
    Row("trajectory of key frames, --gaps fill", trajectory(KEY_FRAMES, "--source-rate", "25", "--gaps", "fill"),
        "told", "poses are interpolated"),
]  # fmt: skip
