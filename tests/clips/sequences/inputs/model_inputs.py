"""Rows of `inputs_tried.py` about models of COLMAP and nerfstudio, and clouds of points."""

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import public_layouts
import raw_sources
from builders import builder
from input_kinds import changed_bytes, each, first_to_last, public, raw, replaced, reworded, with_files, without
from input_rows import centred, close, refused, right, told
from raw_sources import scene_picture

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


def colmap(*words: str, binary: bool = False, frames: int = 6, change=lambda folder: None):
    """A COLMAP model."""
    return raw(lambda folder: raw_sources.colmap(folder, binary, frames), *words, change=change)


def frames_changed(**changes):
    """Every entry of the frames of transforms.json, with keys that are computed from it or added."""

    def entry(frame):
        return frame | {key: value(frame) if callable(value) else value for key, value in changes.items()}

    def change(text: str) -> str:
        data = json.loads(text)
        return json.dumps(data | {"frames": [entry(frame) for frame in data["frames"]]})

    return reworded("transforms.json", change)


@builder
def renamed(folder: Path, listed_in: str, old: str, name, frames: int, inside: str = "") -> None:
    """The pictures of a folder, and the file that lists them `inside` it, with other names by their number."""
    listed = (folder / listed_in).read_text()
    for k in reversed(range(frames)):  # no name is written twice
        os.renames(folder / "images" / old.format(k), folder / "images" / name(k))
        listed = listed.replace(inside + old.format(k), inside + name(k))
    (folder / listed_in).write_text(listed)


def colmap_named(name, frames: int = 12):
    return colmap(frames=frames, change=renamed("sparse/0/images.txt", "frame{:04d}.png", name, frames))


@builder
def scaled_depth(folder: Path, factor: float) -> bool:
    """The depth that was written is the true one times a factor."""
    entry = read_sequence_file(folder / "o").depth
    found = read_png(folder / "o/depth/000002.png") * entry.scale
    return bool(np.abs(found - factor * public_layouts.depth(2)).max() < 1.0)


def in_both_forms(raw: Path) -> None:
    """The binary cameras, and no images.txt."""
    raw_sources.colmap(raw.parent / "b", True, 6)
    shutil.copytree(raw.parent / "b/sparse/0", raw / "sparse/0", dirs_exist_ok=True)
    (raw / "sparse/0/images.txt").unlink()


SCENE = [scene_picture(i) for i in range(12)]


def two_models(raw: Path) -> None:
    """sparse/0 has two pictures, sparse/1 four."""
    shutil.copytree(raw / "sparse/0", raw / "sparse/1")
    reworded("sparse/0/images.txt", first_to_last(0, 4))(raw)
    reworded("sparse/1/images.txt", first_to_last(4))(raw)


@builder
def moved_to(raw: Path, pictures: str, model: str) -> None:
    """Pictures and model in other places."""
    os.renames(raw / "images", raw / pictures)
    os.renames(raw / "sparse/0", raw / model)


@builder
def cameras(raw: Path, *factors: float) -> None:
    """One camera per picture, with these factors of the focal length."""
    lines = [f"{k + 1} PINHOLE 64 48 {60 * f} {61 * f} 30.0 25.0\n" for k, f in enumerate(factors)]
    (raw / "sparse/0/cameras.txt").write_text("".join(lines))
    numbered = lambda found: f" {int(found[1]) % len(factors) + 1} frame{found[1]}"
    reworded("sparse/0/images.txt", lambda text: re.sub(r" 1 frame(\d+)", numbered, text))(raw)


def focal(value: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.fx, value, atol=1e-3)


def as_blender(raw: Path) -> None:
    """Field of view in place of the focal length, no endings, transforms_train.json."""
    frames = json.loads((raw / "transforms.json").read_text().replace(".png", ""))["frames"]
    kept = [{key: frame[key] for key in ("file_path", "transform_matrix")} for frame in frames]
    made = {"camera_angle_x": float(2 * np.arctan(0.64)), "frames": kept}
    (raw / "transforms_train.json").write_text(json.dumps(made))
    (raw / "transforms.json").unlink()


def cloud(form: str, names: str = "x y z", more: str = "", tail: bytes = b""):
    """Points in the place of depth, in `sparse_pc.ply`, with the first property in the last column."""

    def change(raw: Path) -> None:
        shutil.rmtree(raw / "depth")
        rng = np.random.default_rng(0)
        spread = rng.uniform((-0.03, -0.02, 0.05), (0.03, 0.02, 0.05), (60, 3)).astype("f4")
        columns = [spread[:, "xyz".index(name)] if name in "xyz" else np.full(60, 200, "f4") for name in names.split()]
        properties = "".join(f"property float {name}\n" for name in names.split())
        rows = np.stack(columns, axis=1)
        body = {"ascii": "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist()).encode(),
                "binary_little_endian": rows.astype("<f4").tobytes(),
                "binary_big_endian": rows.astype(">f4").tobytes()}[form]  # fmt: skip
        head = f"ply\nformat {form} 1.0\nelement vertex 60\n{properties}{more}end_header\n"
        (raw / "sparse_pc.ply").write_bytes(head.encode() + body + tail)

    return public("nerfstudio", with_depth=False, ply_file_path="sparse_pc.ply", change=change)


def flat_depth(folder: Path) -> bool:
    """The points are on a plane: all depths that were written are equal."""
    seen = read_png(folder / "o/depth/000000.png")
    return bool((seen > 0).mean() > 0.2 and np.ptp(seen[seen > 0]) <= 1)


def beside_a_model(folder: Path) -> None:
    """The project of nerfstudio keeps the COLMAP model from which it was made."""
    raw_sources.colmap(folder / "colmap", False, 4)
    shutil.rmtree(folder / "colmap/images")
    replaced("colmap/sparse/0/images.txt", "frame0", "frame_00")(folder)
    (folder / "colmap/sparse/0/cameras.txt").write_text("1 PINHOLE 128 96 100.0 101.0 64.0 48.0\n")


def other_matrices(change):
    matrix = lambda frame: change(np.array(frame["transform_matrix"])).tolist()
    return public("nerfstudio", change=frames_changed(transform_matrix=matrix))


MODEL_ROWS = [
    refused("depth beside COLMAP", colmap("--depth", "d"), "does not read --depth"),
    right("COLMAP, numbered without zeros", colmap_named(lambda k: f"frame{k}.png"), close(SCENE, 0.01)),
    told("COLMAP, frames that are not registered", colmap_named(lambda k: f"frame{k + 3 * (k > 5):04d}.png"),
        "frames count as evenly spaced in time", close(SCENE, 0.01)),
    refused("COLMAP, names without an order", colmap_named(lambda k: "overview.png" if k == 5 else f"frame{k}.png"),
        "numbers in this name: 0"),
    refused("COLMAP, images in the binary form alone", colmap(change=in_both_forms), "images.txt: file not found"),
    told("COLMAP, two models, the first is the small one", colmap(change=two_models),
        "sparse/1 is read, the largest model; not read: sparse/0 (2 pictures)", close(SCENE[2:6], 0.01)),
    told("COLMAP, two models, --model", colmap("--model", "sparse/0", change=two_models), "as stated", close(SCENE[:2],
        0.01)),
    refused("COLMAP, pictures of half the size", colmap(change=each("images", lambda shown: shown[::2, ::2])),
        "and --scale 0.5"),
    refused("COLMAP, a window of the pictures", colmap(change=each("images", lambda shown: shown[:, 8:])),
        "these were cropped or squeezed"),
    refused("COLMAP, --model that is not there", colmap("--model", "3", change=two_models),
        "use sparse/0 or sparse/1"),
    told("COLMAP, a picture that is not registered", colmap(change=reworded("sparse/0/images.txt", first_to_last(0,
        -2))), "1 pictures are not registered", close(SCENE[:5], 0.01)),
    right("COLMAP, dense/0/sparse", colmap(change=moved_to("dense/0/images", "dense/0/sparse")), close(SCENE[:6],
        0.01)),
    told("COLMAP, no points3D", colmap(change=without("sparse/0/points3D.txt")), "training needs depth",
        close(SCENE[:6], 0.01)),
    told("COLMAP, one camera per picture", colmap(change=cameras(1.0, 1.001, 0.999)), "one camera per picture",
        focal(60)),
    refused("COLMAP, cameras that differ", colmap(change=cameras(1.0, 1.1)), "the cameras of the pictures differ"),
    told("COLMAP, left and right in one model", colmap_named(lambda k: f"{('left', 'right')[k // 3]}/{k % 3:04d}.png",
        6), "3 pictures of right/ not read", close(SCENE[:3], 0.01)),
    refused("COLMAP, images.txt without lines of points", colmap(change=reworded("sparse/0/images.txt", first_to_last(0,
        step=2))), "every picture has two lines"),
    *(refused(f"COLMAP, bytes behind the last entry of {name}.bin", colmap(binary=True, change=lambda raw,
        name=name: changed_bytes(lambda data: data + bytes(16))(raw / f"sparse/0/{name}.bin")),
        "bytes behind the last entry") for name in ("cameras", "images", "points3D")),
    told("COLMAP, a text model and a binary model in one folder",
        colmap(change=with_files(*(f"sparse/0/{name}.bin" for name in ("cameras", "images", "points3D")),
        text="\0" * 8)), "the text files are read, not the binary ones"),
    told("COLMAP, points that points3D lacks", colmap(change=reworded("sparse/0/points3D.txt", first_to_last(0, -3))),
        "are not in points3D"),
    told("COLMAP, masks beside it", colmap(change=with_files("masks/frame0000.png")), "not read: masks/; see --masks"),
    right("COLMAP, rigs and frames of its new versions", colmap(change=with_files("sparse/0/rigs.txt",
        "sparse/0/frames.txt"))),
    told("COLMAP, points3D without a point", colmap(change=with_files("sparse/0/points3D.txt", text="# none")),
        "no frame has depth"),
    told("nerfstudio", public("nerfstudio"), "unit of lengths unknown", centred),
    refused("nerfstudio, fisheye", public("nerfstudio", camera_model="OPENCV_FISHEYE"), "camera_model"),
    refused("nerfstudio, a picture missing", public("nerfstudio", change=without("images/frame_00002.png")),
        "frame_00002.png"),
    told("nerfstudio, out and for COLMAP", public("nerfstudio", "--also", "nerfstudio", "colmap"),
        "points of the prior depth", centred),
    right("nerfstudio, numbered without zeros", public("nerfstudio", change=renamed("transforms.json",
        "frame_{:05d}.png", lambda k: f"frame_{k + 8}.png", 4, "images/")),
        close([public_layouts.picture(i) for i in range(len(public_layouts.poses()))], 0.01)),
    told("nerfstudio, applied_scale and depth", public("nerfstudio", "--trajectory-unit", "m", applied_scale=0.5),
        "applied_scale: depth files and points are multiplied by 0.5", scaled_depth(0.5)),
    told("nerfstudio, separators of Windows", public("nerfstudio", change=replaced("transforms.json", "./images/",
        ".\\\\images\\\\")), "unit of lengths unknown", centred),
    told("nerfstudio, --trajectory-unit", public("nerfstudio", "--trajectory-unit", "m"), "unit of lengths m",
        lambda folder: scaled_depth(1.0)(folder) and read_sequence_file(folder / "o").unit == "mm"),
    told("Blender, transforms_train.json", public("nerfstudio", change=as_blender), "transforms_train.json",
        focal(100)),
    refused("nerfstudio, transposed matrices", other_matrices(np.transpose), "is the matrix transposed?"),
    told("nerfstudio, pictures that the file does not list", public("nerfstudio",
        change=lambda raw: shutil.copy(raw / "images/frame_00000.png", raw / "images/frame_00099.png")),
        "not listed in transforms.json and are left out"),
    told("nerfstudio, depth and masks that the file does not name", public("nerfstudio", with_depth=False,
        change=with_files("sam/0.png")), "not read: depth/, sam/"),
    told("nerfstudio, its COLMAP model beside it", public("nerfstudio", change=beside_a_model),
        "transforms.json: not read, because the COLMAP model is"),
    told("nerfstudio, fields of newer programs", public("nerfstudio", change=frames_changed(normal_file_path="n.png",
        original_fps=30)), "unknown here: normal_file_path, original_fps"),
    refused("nerfstudio, one time for all frames", public("nerfstudio", change=frames_changed(time=0.0)),
        "two frames have one time"),
    refused("nerfstudio, left-handed matrices", other_matrices(lambda matrix: matrix @ np.diag([1.0, 1, -1, 1])),
        "a mirror image"),
    refused("nerfstudio, scaled rotations", other_matrices(lambda matrix: matrix @ np.diag([2.0, 2, 2, 1])),
        "not perpendicular unit vectors"),
    refused("nerfstudio, sizes of other pictures", public("nerfstudio", w=256, h=192),
        "the intrinsics are of 256x192 pixels"),
    refused("nerfstudio, paths of another machine", public("nerfstudio",
        change=frames_changed(file_path=lambda frame: f"/home/a/{frame['file_path']}")),
        "is an absolute path; write it from the folder of the file"),
    right("points, x y z behind the colours", cloud("ascii", "red green blue z y x"), flat_depth),
    right("points, little-endian", cloud("binary_little_endian"), flat_depth),
    right("points, big-endian", cloud("binary_big_endian"), flat_depth),
    told("points, faces behind the vertices", cloud("ascii", more="element face 2\nproperty list uchar int v\n",
        tail=b"3 0 1 2\n3 1 2 3\n"), "not used: its face", flat_depth),
    told("points, a property that is not known", cloud("ascii", "x y z lidar_ring"), "unknown here: lidar_ring",
        flat_depth),
    told("points, the file is not there", public("nerfstudio", with_depth=False, ply_file_path="sparse_pc.ply"),
        "sparse_pc.ply is not there"),
]  # fmt: skip
