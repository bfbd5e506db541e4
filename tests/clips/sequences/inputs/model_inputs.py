"""Rows of `inputs_tried.py` about models of COLMAP and nerfstudio, and clouds of points."""

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import public_layouts
import raw_sources
from builders import builder
from input_kinds import Row, centred, close, first_to_last, public, raw, reworded, with_files
from raw_sources import scene_picture

from endotsr.clips.opencv.png import read_png, write_png
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
        (folder / "images" / old.format(k)).rename(folder / "images" / name(k))
        listed = listed.replace(inside + old.format(k), inside + name(k))
    (folder / listed_in).write_text(listed)


def colmap_named(name):
    return colmap(frames=12, change=renamed("sparse/0/images.txt", "frame{:04d}.png", name, 12))


RECONSTRUCTED = [raw_sources.scene_picture(i) for i in range(12)]


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


MODEL_FRAMES = 6
MODEL_PICTURES = [scene_picture(i) for i in range(MODEL_FRAMES)]


def part_of(model: Path, out: Path, first: int, last: int) -> None:
    """A text model with some of the pictures of another one."""
    shutil.copytree(model, out)
    reworded("images.txt", first_to_last(2 * first, 2 * last))(out)


def two_models(raw: Path) -> None:
    """sparse/0 has two pictures, sparse/1 four."""
    (raw / "sparse/0").rename(raw / "whole")
    part_of(raw / "whole", raw / "sparse/0", 0, 2)
    part_of(raw / "whole", raw / "sparse/1", 2, MODEL_FRAMES)
    shutil.rmtree(raw / "whole")


@builder
def moved_to(raw: Path, pictures: str, model: str) -> None:
    """Pictures and model in other places."""
    (raw / "images").rename(raw / "p")
    (raw / "sparse/0").rename(raw / "m")
    shutil.rmtree(raw / "sparse")
    for name, place in (("p", pictures), ("m", model)):
        (raw / place).parent.mkdir(parents=True, exist_ok=True)
        (raw / name).rename(raw / place)


@builder
def cameras(raw: Path, *factors: float) -> None:
    """One camera per picture, with these factors of the focal length."""
    model = raw / "sparse/0"
    (model / "cameras.txt").write_text(
        "".join(f"{k + 1} PINHOLE 64 48 {60 * f} {61 * f} 30.0 25.0\n" for k, f in enumerate(factors))
    )
    lines = (model / "images.txt").read_text().splitlines()
    for k in range(0, len(lines), 2):
        words = lines[k].split()
        words[8] = str(k // 2 % len(factors) + 1)
        lines[k] = " ".join(words)
    (model / "images.txt").write_text("\n".join(lines) + "\n")


def both_sides(raw: Path) -> None:
    """Pictures of left/ and right/ in one model: frames 0 to 2 of each."""
    listed = (raw / "sparse/0/images.txt").read_text()
    for k in range(MODEL_FRAMES):
        side, number = ("left", k) if k < MODEL_FRAMES // 2 else ("right", k - MODEL_FRAMES // 2)
        name = f"{side}/{number:04d}.png"
        (raw / "images" / side).mkdir(exist_ok=True)
        (raw / f"images/frame{k:04d}.png").rename(raw / "images" / name)
        listed = listed.replace(f"frame{k:04d}.png", name)
    (raw / "sparse/0/images.txt").write_text(listed)


def focal(value: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.fx, value, atol=1e-3)


def as_blender(raw: Path) -> None:
    """Field of view in place of the focal length, no endings, transforms_train.json."""
    file = raw / "transforms.json"
    frames = json.loads(file.read_text().replace(".png", ""))["frames"]
    kept = [{key: frame[key] for key in ("file_path", "transform_matrix")} for frame in frames]
    (raw / "transforms_train.json").write_text(
        json.dumps({"camera_angle_x": float(2 * np.arctan(0.64)), "frames": kept})
    )
    file.unlink()


@builder
def longer(raw: Path, name: str) -> None:
    """A binary file with bytes behind its last entry, as another version of its format has."""
    file = raw / f"sparse/0/{name}.bin"
    file.write_bytes(file.read_bytes() + bytes(16))


def both_forms(raw: Path) -> None:
    """An older binary model beside the text model."""
    for name in ("cameras", "images", "points3D"):
        (raw / f"sparse/0/{name}.bin").write_bytes(struct.pack("<Q", 0))


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
    raw_sources.colmap(folder / "made", False, 4)
    shutil.copytree(folder / "made/sparse/0", folder / "colmap/sparse/0")
    shutil.rmtree(folder / "made")
    model = folder / "colmap/sparse/0"
    (model / "images.txt").write_text((model / "images.txt").read_text().replace("frame0", "frame_00"))
    (model / "cameras.txt").write_text("1 PINHOLE 128 96 100.0 101.0 64.0 48.0\n")


def other_matrices(right: np.ndarray):
    matrix = lambda frame: (np.array(frame["transform_matrix"]) @ right).tolist()
    return public("nerfstudio", change=frames_changed(transform_matrix=matrix))


def half_pictures(folder: Path) -> None:
    for file in (folder / "images").iterdir():
        write_png(file, read_png(file)[::2, ::2])


MODEL_ROWS = [
    Row("depth beside COLMAP", colmap("--depth", "d"), "refused", "does not read --depth"),
    Row("COLMAP, numbered without zeros", colmap_named(lambda k: f"frame{k}.png"), "right", "", close(RECONSTRUCTED,
        0.01)),
    Row("COLMAP, frames that are not registered", colmap_named(lambda k: f"frame{k + 3 * (k > 5):04d}.png"), "told",
        "frames count as evenly spaced in time", close(RECONSTRUCTED, 0.01)),
    Row("COLMAP, names without an order", colmap_named(lambda k: "overview.png" if k == 5 else f"frame{k}.png"),
        "refused", "numbers in this name: 0"),
    Row("COLMAP, images in the binary form alone", colmap(change=in_both_forms), "refused",
        "images.txt: file not found"),
    Row("COLMAP, two models, the first is the small one", colmap(change=two_models), "told",
        "sparse/1 is read, the largest model; not read: sparse/0 (2 pictures)", close(MODEL_PICTURES[2:], 0.01)),
    Row("COLMAP, two models, --model", colmap("--model", "sparse/0", change=two_models), "told", "as stated",
        close(MODEL_PICTURES[:2], 0.01)),
    Row("COLMAP, --model that is not there", colmap("--model", "3", change=two_models), "refused",
        "use sparse/0 or sparse/1"),
    Row("COLMAP, a picture that is not registered", colmap(change=reworded("sparse/0/images.txt", first_to_last(0,
        -2))), "told", "1 pictures are not registered", close(MODEL_PICTURES[:-1], 0.01)),
    Row("COLMAP, dense/0/sparse", colmap(change=moved_to("dense/0/images", "dense/0/sparse")), "right", "",
        close(MODEL_PICTURES, 0.01)),
    Row("COLMAP, input/ and distorted/", colmap(change=moved_to("input", "distorted/sparse/0")), "right", "",
        close(MODEL_PICTURES, 0.01)),
    Row("COLMAP, no points3D", colmap(change=lambda raw: (raw / "sparse/0/points3D.txt").unlink()), "told",
        "training needs depth", close(MODEL_PICTURES, 0.01)),
    Row("COLMAP, one camera per picture", colmap(change=cameras(1.0, 1.001, 0.999)), "told", "one camera per picture",
        focal(60)),
    Row("COLMAP, cameras that differ", colmap(change=cameras(1.0, 1.1)), "refused",
        "the cameras of the pictures differ"),
    Row("COLMAP, left and right in one model", colmap(change=both_sides), "told", "3 pictures of right/ not read",
        close(MODEL_PICTURES[:3], 0.01)),
    Row("COLMAP, images.txt without lines of points", colmap(change=reworded("sparse/0/images.txt", first_to_last(0,
        step=2))), "refused", "every picture has two lines"),
    *(Row(f"COLMAP, bytes behind the last entry of {name}.bin", colmap(binary=True, change=longer(name)), "refused",
        "bytes behind the last entry") for name in ("cameras", "images", "points3D")),
    Row("COLMAP, a text model and a binary model in one folder", colmap(change=both_forms), "told",
        "the text files are read, not the binary ones"),
    Row("COLMAP, points that points3D lacks", colmap(change=reworded("sparse/0/points3D.txt", first_to_last(0, -3))),
        "told", "are not in points3D"),
    Row("COLMAP, masks beside it", colmap(change=with_files("masks/frame0000.png")), "told",
        "not read: masks/; see --masks"),
    Row("COLMAP, rigs and frames of its new versions", colmap(change=with_files("sparse/0/rigs.txt",
        "sparse/0/frames.txt")), "right", ""),
    Row("COLMAP, pictures of half the size", colmap(change=half_pictures), "refused", "the intrinsics are of 64x48"),
    Row("COLMAP, points3D without a point", colmap(change=lambda folder: (folder /
        "sparse/0/points3D.txt").write_text("# none")), "told", "no frame has depth"),
    Row("nerfstudio", public("nerfstudio"), "told", "unit of lengths unknown", centred),
    Row("nerfstudio, fisheye", public("nerfstudio", camera_model="OPENCV_FISHEYE"), "refused", "camera_model"),
    Row("nerfstudio, a picture missing", public("nerfstudio",
        change=lambda raw: (raw / "images/frame_00002.png").unlink()), "refused", "frame_00002.png"),
    Row("nerfstudio, out and for COLMAP", public("nerfstudio", "--also", "nerfstudio", "colmap"), "told",
        "points of the prior depth", centred),
    Row("nerfstudio, numbered without zeros", public("nerfstudio", change=renamed("transforms.json", "frame_{:05d}.png",
        lambda k: f"frame_{k + 8}.png", 4, "images/")), "right", "",
        close([public_layouts.picture(i) for i in range(len(public_layouts.poses()))], 0.01)),
    Row("nerfstudio, applied_scale and depth", public("nerfstudio", "--trajectory-unit", "m", applied_scale=0.5),
        "told", "applied_scale: depth files and points are multiplied by 0.5", scaled_depth(0.5)),
    Row("nerfstudio, without applied_scale", public("nerfstudio", "--trajectory-unit", "m"), "right", "",
        scaled_depth(1.0)),
    Row("nerfstudio, separators of Windows", public("nerfstudio", change=reworded("transforms.json",
        lambda text: text.replace("./images/", ".\\\\images\\\\"))), "told", "unit of lengths unknown", centred),
    Row("nerfstudio, --trajectory-unit", public("nerfstudio", "--trajectory-unit", "m"), "told", "unit of lengths m",
        lambda folder: read_sequence_file(folder / "o").unit == "mm"),
    Row("Blender, transforms_train.json", public("nerfstudio", change=as_blender), "told", "transforms_train.json",
        lambda folder: np.isclose(read_sequence_file(folder / "o").camera.fx, 100)),
    Row("nerfstudio, transposed matrices", public("nerfstudio",
        change=frames_changed(transform_matrix=lambda frame: np.array(frame["transform_matrix"]).T.tolist())),
        "refused", "is the matrix transposed?"),
    Row("nerfstudio, pictures that the file does not list", public("nerfstudio",
        change=lambda raw: shutil.copy(raw / "images/frame_00000.png", raw / "images/frame_00099.png")), "told",
        "not listed in transforms.json and are left out"),
    Row("nerfstudio, depth and masks that the file does not name", public("nerfstudio", with_depth=False,
        change=with_files("sam/0.png")), "told", "not read: depth/, sam/"),
    Row("nerfstudio, its COLMAP model beside it", public("nerfstudio", change=beside_a_model), "told",
        "transforms.json: not read, because the COLMAP model is"),
    Row("nerfstudio, fields of newer programs", public("nerfstudio", change=frames_changed(normal_file_path="n.png",
        original_fps=30)), "told", "unknown here: normal_file_path, original_fps"),
    Row("nerfstudio, one time for all frames", public("nerfstudio", change=frames_changed(time=0.0)), "refused",
        "two frames have one time"),
    Row("nerfstudio, left-handed matrices", other_matrices(np.diag([1.0, 1, -1, 1])), "refused", "a mirror image"),
    Row("nerfstudio, scaled rotations", other_matrices(np.diag([2.0, 2, 2, 1])), "refused",
        "not perpendicular unit vectors"),
    Row("nerfstudio, sizes of other pictures", public("nerfstudio", w=256, h=192), "refused",
        "the intrinsics are of 256x192 pixels"),
    Row("nerfstudio, paths of another machine", public("nerfstudio",
        change=frames_changed(file_path=lambda frame: f"/home/a/{frame['file_path']}")), "refused",
        "is an absolute path; write it from the folder of the file"),
    Row("points, x y z behind the colours", cloud("ascii", "red green blue z y x"), "right", "", flat_depth),
    Row("points, little-endian", cloud("binary_little_endian"), "right", "", flat_depth),
    Row("points, big-endian", cloud("binary_big_endian"), "right", "", flat_depth),
    Row("points, faces behind the vertices", cloud("ascii", more="element face 2\nproperty list uchar int v\n",
        tail=b"3 0 1 2\n3 1 2 3\n"), "told", "not used: its face", flat_depth),
    Row("points, a property that is not known", cloud("ascii", "x y z lidar_ring"), "told", "unknown here: lidar_ring",
        flat_depth),
    Row("points, the file is not there", public("nerfstudio", with_depth=False, ply_file_path="sparse_pc.ply"), "told",
        "sparse_pc.ply is not there"),
]  # fmt: skip
