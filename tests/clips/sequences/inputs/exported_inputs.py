"""Rows of `inputs_tried.py` about exports of other programs: steps, marks, orders, bits and sizes."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import raw_sources
from builders import builder
from depth_folders import true_depth
from input_kinds import (
    Row,
    calibrated,
    close,
    colmap,
    converted,
    depth,
    depth_files,
    depth_is_true,
    folder_of,
    frames_changed,
    half_excluded,
    mask,
    masked,
    named,
    prepare,
    public,
    raw,
    reworded,
    tiff,
    trajectory,
)
from made_videos import HEIGHT, files, picture, pictures, write
from odd_inputs import marked, with_camera
from PIL import Image
from silent_inputs import in_one_file, of_orb_slam

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


def steps_per_metre(steps: int, key: str = "DepthMapFactor"):
    """A TUM folder whose settings of ORB-SLAM state the steps of its depth, usually 5000 a metre."""

    def change(folder: Path) -> None:
        of_orb_slam(folder)
        reworded("TUM1.yaml", lambda text: text.replace("DepthMapFactor: 5000", f"{key}: {steps}"))(folder)

    return raw(raw_sources.tum, change=change)


@builder
def median_depth(folder: Path, millimetres: float) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return entry is not None and np.isclose(
        np.median(read_png(folder / "o/depth/000000.png")) * entry.scale, millimetres, rtol=1e-3
    )


def beside_a_model(folder: Path) -> None:
    """The project of nerfstudio keeps the COLMAP model from which it was made."""
    raw_sources.colmap(folder / "made", False, 4)
    shutil.copytree(folder / "made/sparse/0", folder / "colmap/sparse/0")
    shutil.rmtree(folder / "made")
    model = folder / "colmap/sparse/0"
    (model / "images.txt").write_text((model / "images.txt").read_text().replace("frame0", "frame_00"))
    (model / "cameras.txt").write_text("1 PINHOLE 128 96 100.0 101.0 64.0 48.0\n")


@builder
def of_all_frames(folder: Path, planes, option: str, name=lambda k: f"{k}.png") -> list[str]:
    """One array for the clip, in the order of these names sorted as text."""
    files(folder, "clip", pictures())
    for k, file in enumerate(sorted((folder / "clip").iterdir())):
        file.rename(file.with_name(name(k)))
    np.save(folder / "a.npy", np.stack([planes(k) for k in sorted(range(12), key=name)]))
    return [*prepare("clip")(folder), option, str(folder / "a.npy")]


@builder
def saved(folder: Path, save, ending: str) -> None:
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


def wide_tiff(path: Path, plane: np.ndarray, black_is_zero: int = 1) -> None:
    """Hundredths of a millimetre."""
    stored = np.round(plane * 100).astype(np.uint16)
    tiff(path, stored if black_is_zero else 65535 - stored, black_is_zero, 16)


def signed_tiff(path: Path, plane: np.ndarray) -> None:
    """Hundredths of a millimetre, and -1 in a corner."""
    stored = np.round(plane * 100).astype(np.int16)
    stored[:20, :30] = -1
    tiff(path, stored.view(np.uint16), 1, 16, sign=2)


def corner_is_empty(folder: Path) -> bool:
    plane = read_png(folder / "o/depth/000002.png")
    return not plane[:20, :30].any() and bool((plane[20:] > 0).all())


def links(folder: Path) -> None:
    """The pictures are links to files of another folder."""
    os.rename(folder / "clip", folder / "real")
    (folder / "clip").mkdir()
    for file in (folder / "real").iterdir():
        os.symlink(file, folder / "clip" / file.name)


def broken_link(folder: Path) -> None:
    (folder / "clip/0003.png").unlink()
    os.symlink(folder / "nothing.png", folder / "clip/0003.png")


def pulled_down(folder: Path) -> list[str]:
    """Film of 24 pictures a second as video of 30: two of five pictures join two moments, and no mark says so."""
    film = [picture(2 * i) for i in range(32)]
    even = (np.arange(HEIGHT) % 2 == 0)[:, None, None]
    frames = []
    for a, b, c, d in zip(*(film[k::4] for k in range(4))):
        frames += [a, b, np.where(even, b, c), np.where(even, c, d), d]
    write(folder / "a.mp4", frames, rate=30, options={"qp": "4"})
    return prepare("a.mp4")(folder)


def numbered_from_1(folder: Path) -> list[str]:
    words = masked([mask()] * 12)(folder)
    (folder / "m/0000.png").unlink()
    return words


def other_matrices(right: np.ndarray):
    matrix = lambda frame: (np.array(frame["transform_matrix"]) @ right).tolist()
    return public("nerfstudio", change=frames_changed(transform_matrix=matrix))


def frames_last(folder: Path) -> list[str]:
    words = in_one_file(".npy")(folder)
    np.save(folder / "clip.npy", np.load(folder / "clip.npy").transpose(1, 2, 0))
    return words


def with_confidence(folder: Path) -> list[str]:
    words = in_one_file(".npz")(folder)
    planes = np.load(folder / "clip.npz")["depths"]
    np.savez(folder / "clip.npz", depths=planes, confidence=np.ones_like(planes))
    return words


def half_pictures(folder: Path) -> None:
    for file in (folder / "images").iterdir():
        write_png(file, read_png(file)[::2, ::2])


def pil(ending: str, change=lambda opened: opened, **how):
    return folder_of(pictures(), change=converted(ending, change, **how))


LOST = [f"{i / 25:.2f} {'nan ' * 7 if i == 4 else '0 0 0 0 0 0 1'}" for i in range(12)]
METASHAPE = "<?xml version='1.0'?><calibration><projection>frame</projection><f>100</f></calibration>"
NORMALISED = json.dumps({"K": [[0.78, 0, 0.5], [0, 1.05, 0.5], [0, 0, 1]]})
HALF = "50 0 31.5\n0 50 23.5\n0 0 1\n"
EXPORTED_ROWS = [
    Row("TUM, settings that state the steps of the depth", steps_per_metre(1000), "told",
        "TUM1.yaml: DepthMapFactor: the depth has 1000 steps per metre", median_depth(300)),
    Row("TUM, settings of ORB-SLAM3 that state the steps of the depth", steps_per_metre(1000, "RGBD.DepthMapFactor"),
        "told", "RGBD.DepthMapFactor: the depth has 1000 steps per metre", median_depth(300)),
    Row("nerfstudio, its COLMAP model beside it", public("nerfstudio", change=beside_a_model), "told",
        "transforms.json: not read, because the COLMAP model is"),
    Row("depth, one array in the order of names as text", of_all_frames(lambda k: true_depth(k).astype(np.float32),
        "--depth"), "told", "10.png stands in the place of 2.png"),
    Row("masks, one array in the order of names as text", of_all_frames(lambda k: np.roll(mask(), 5 * k, axis=1) > 0,
        "--masks"), "told", "10.png stands in the place of 2.png"),
    Row("depth, a far plane where there is none", depth(marked(150.0)), "refused", "have the depth 150 in every frame"),
    Row("depth, the least number of a network where there is none", depth(marked(1e-3)), "refused",
        "have the depth 0.001 in every frame"),
    Row("masks, TIFF of probabilities", masked([mask()] * 12, change=saved(numbers(0.98, 3), ".tif")), "refused",
        "a threshold, such as > 0.5"),
    Row("masks, TIFF of 0 and 1 as numbers with a point", masked([mask()] * 12, change=saved(numbers(1.0), ".tif")),
        "right", "", half_excluded),
    Row("masks, TIFF of 0 and 0.5", masked([mask()] * 12, change=saved(numbers(0.5), ".tif")), "refused",
        "holds 0.5; use whole numbers"),
    Row("camera of half the size", with_camera("50", "50", "32", "24"), "told", "of 0.5 times this size"),
    Row("camera of two thirds of the size", with_camera("67", "67", "42.7", "32"), "told", "of 0.667 times this size"),
    Row("calibration, matrix K of half the size", calibrated("K.txt", HALF), "told", "of 0.5 times this size"),
    Row("camera of one and a half times the size", with_camera("150", "150", "96", "72"), "told",
        "of 1.5 times this size"),
    Row("camera in the order fx cx fy cy", with_camera("100", "64", "101", "48"), "told", "principal-point"),
    Row("video, film as video of 30 a second, without a mark", pulled_down, "told", "in 16 of 40 frames"),
    Row("depth, TIFF of 16 bit in which 0 is white", depth_files(lambda path, plane: wide_tiff(path, plane, 0), ".tif",
        "--depth-scale", "0.01"), "refused", "states that 0 is white"),
    Row("depth, TIFF of 16 bit", depth_files(wide_tiff, ".tif", "--depth-scale", "0.01"), "right", "", depth_is_true),
    Row("depth, TIFF of 16 bit with a sign and -1 where there is none", depth_files(signed_tiff, ".tif",
        "--depth-scale", "0.01"), "right", "", corner_is_empty),
    Row("masks, TIFF of 16 bit in which 0 is white", masked([mask()] * 12, change=saved(lambda path, plane: tiff(path,
        65535 - 257 * plane.astype(np.uint16), 0, 16), ".tif")), "refused", "states that 0 is white"),
    *(Row(f"masks, TIFF of {bits} bit in which 0 is white", masked([mask()] * 12, change=saved(
        lambda path, plane, bits=bits: tiff(path, (plane == 0) if bits == 1 else 255 - plane, 0, bits), ".tif")),
        "right", "", half_excluded) for bits in (1, 8)),
    *(Row(f"masks, {name} of 1 bit", masked([mask()] * 12, change=saved(lambda path, plane: Image.fromarray(
        plane > 0).save(path), f".{name}")), "right", "", half_excluded) for name in ("png", "tif", "bmp")),
    Row("masks, TIFF of int32", masked([mask()] * 12, change=saved(lambda path, plane: Image.fromarray(
        (plane > 0).astype(np.int32)).save(path), ".tif")), "right", "", half_excluded),
    Row("masks, smooth edges, of another size", masked([mask()] * 12, change=saved(lambda path, plane: Image.fromarray(
        plane).resize((300, 225), Image.Resampling.BICUBIC).save(path), ".png")), "right", "", half_excluded),
    Row("masks numbered from 1, the last one missing", numbered_from_1, "refused", "1 of 12 frames have no mask"),
    Row("depth, log of millimetres", depth(lambda i: np.log(true_depth(i))), "refused", "the median depth is 3.977"),
    Row("depth, one array with the frames last", frames_last, "refused", "depth of 6x128 pixels"),
    Row("depth, one array beside its confidence", with_confidence, "refused", "holds depths (6, 96, 128), confidence"),
    Row("pictures, TIFF of CMYK", pil("tif", lambda opened: opened.convert("CMYK")), "right", "", close(pictures())),
    Row("pictures, TIFF of YCbCr", pil("tif", lambda opened: opened.convert("YCbCr")), "right", "", close(pictures())),
    Row("pictures, TIFF with JPEG", pil("tif", compression="jpeg", quality=95), "right", "", close(pictures())),
    Row("pictures, progressive jpg", pil("jpg", progressive=True, quality=95), "right", "", close(pictures())),
    Row("pictures, jpg stored as RGB", pil("jpg", keep_rgb=True, quality=95), "right", "", close(pictures())),
    Row("pictures, BigTIFF", pil("tif", big_tiff=True), "refused", "not a TIFF file by its first bytes"),
    Row("pictures, links to files", folder_of(pictures(), change=links), "right", "", close(pictures(), 0.01)),
    Row("pictures, a broken link", folder_of(pictures(), change=broken_link), "refused", "0003.png: cannot be read"),
    Row("pictures, two names in other case", folder_of(pictures(),
        change=lambda folder: shutil.copy(folder / "clip/0003.png", folder / "clip/0003.PNG")), "refused",
        "carry the same frame number"),
    Row("names whose zeros change", named(lambda k: f"{k + 95:0{2 if k < 3 else 5}d}.png"), "right", "",
        close(pictures(), 0.01)),
    Row("names in hexadecimal numbers", named(lambda k: f"frame_{k:02x}.png"), "refused",
        "carry the same frame number"),
    Row("names of a counter that begins again", named(lambda k: f"IMG_{(9994 + k) % 10000:04d}.png"), "told",
        "between IMG_0005.png and IMG_9994.png"),
    Row("nerfstudio, fields of newer programs", public("nerfstudio", change=frames_changed(
        normal_file_path="n.png", original_fps=30)), "told",
        "unknown here: normal_file_path, original_fps"),
    Row("nerfstudio, one time for all frames", public("nerfstudio", change=frames_changed(time=0.0)),
        "refused", "two frames have one time"),
    Row("nerfstudio, left-handed matrices", other_matrices(np.diag([1.0, 1, -1, 1])), "refused", "a mirror image"),
    Row("nerfstudio, scaled rotations", other_matrices(np.diag([2.0, 2, 2, 1])), "refused",
        "not perpendicular unit vectors"),
    Row("nerfstudio, sizes of other pictures", public("nerfstudio", w=256, h=192), "refused",
        "the intrinsics are of 256x192 pixels"),
    Row("COLMAP, pictures of half the size", colmap(change=half_pictures), "refused", "the intrinsics are of 64x48"),
    Row("COLMAP, points3D without a point", colmap(change=lambda folder: (folder / "sparse/0/points3D.txt").write_text(
        "# none")), "told", "no frame has depth"),
    Row("trajectory, a lost frame as nan", trajectory(LOST), "refused", "line 5: use 8 finite numbers"),
    Row("calibration of Metashape", calibrated("a.xml", METASHAPE), "refused", "the root is calibration"),
    Row("calibration, parts of the picture in JSON", calibrated("a.json", NORMALISED), "told", "field-of-view"),
]  # fmt: skip
