"""Rows of `inputs_tried.py` about files that programs write by the way: names, bits, channels, marks and metadata."""

import struct
from pathlib import Path

import numpy as np
import public_layouts
import raw_sources
from builders import builder
from depth_folders import true_depth
from input_kinds import (
    Row,
    blank,
    close,
    colmap,
    converted,
    depth,
    depth_files,
    depth_is_true,
    files,
    folder_of,
    half_excluded,
    labels,
    mask,
    masked,
    named,
    pair,
    prepare,
    public,
    rewritten,
    size,
    trajectory,
    video,
    with_files,
)
from made_videos import WIDTH, picture, pictures
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from stereo_pairs import slanted_pair

from endotsr.cli.main import main
from endotsr.clips.opencv.pictures import write_jpeg

HOLE = (slice(0, 20), slice(0, 30))  # of the depth


def linear() -> PngInfo:
    chunks = PngInfo()
    chunks.add(b"gAMA", struct.pack(">I", 100000))
    return chunks


def gif(folder: Path) -> list[str]:
    made = [Image.fromarray(shown) for shown in pictures()]
    made[0].save(folder / "a.gif", save_all=True, append_images=made[1:], duration=40)
    return prepare("a.gif")(folder)


@builder
def with_camera(folder: Path, *camera) -> list[str]:
    files(folder, "clip", pictures())
    return prepare("clip", camera=("--camera", *camera))(folder)


def exchanged(folder: Path) -> list[str]:
    """Depth of pairs whose left pictures are those of the right camera."""
    left, right, *_ = slanted_pair()
    pair(frames=([right] * 3, [left] * 3))(folder)
    moving = [[np.roll(p, k, axis=0) for k in range(3)] for p in (right, left)]
    for name, frames in zip(("left", "right"), moving):
        for k, shown in enumerate(frames):
            write_jpeg(folder / f"clip/{name}/{k:04d}.jpg", shown, 100)
            (folder / f"clip/{name}/{k:04d}.png").unlink()
    height, width = left.shape[:2]
    lens = ("--camera", "300", "310", str(width / 2), str(height / 2))
    assert main(prepare("clip", "--baseline", "4", camera=lens)(folder)) == 0
    return ["depth", str(folder / "o")]


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
POSES = [f"{i} {0.001 * i} 0 0 0 0 0 1" for i in range(15)]
IN_TURN = [shown for i in range(6) for shown in (picture(i), np.roll(picture(i), -20, axis=1))]
ODD_ROWS = [
    Row("video, 4:2:0 of odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1"), "right", "",
        size(127, 95)),
    Row("video, 12 bit", video("a.mkv", codec="libx265", layout="yuv420p12le"), "right", "", close(pictures())),
    Row("video, RGB of 16 bit", video("a.mkv", codec="ffv1", layout="gbrp16le"), "right", "", close(pictures(), 1)),
    Row("video, linear light", video("a.mp4", layout="yuv444p", transfer=8), "refused", "linear light"),
    Row("video, colours of BT.2020", video("a.mkv", codec="libx265", layout="yuv420p10le", primaries=9), "told",
        "states BT.2020 colours"),
    Row("video, left and right in turn", video("a.mp4", IN_TURN), "told", "alternating-views"),
    Row("GIF", gif, "refused", "no known layout"),
    Row("pictures, moving PNG", folder_of(pictures(), change=converted("png", save_all=True, append_images=[blank()])),
        "refused", "holds 2 pictures"),
    Row("pictures, negatives", folder_of([255 - p for p in pictures()]), "told", "negative-pictures"),
    Row("pictures, red and blue exchanged", folder_of([p[..., ::-1] for p in pictures()]), "told", "blue-pictures"),
    Row("pictures, PNG that states linear light", folder_of(pictures(), change=converted("png", pnginfo=linear())),
        "told", "other than sRGB", close(pictures(), 0.01)),
    Row("pictures, JPEG without an ending of it", folder_of(pictures(), change=converted("png", format="JPEG")),
        "refused", "does not start with the PNG signature"),
    Row("names beyond ASCII", named(lambda k: f"épreuve 画像 {k}.png"), "right", "", close(pictures(), 0.01)),
    Row("names with times of unlike length", named(lambda k: f"{10 + 0.25 * k}.png"), "refused", "number of decimals"),
    Row("names with times of one length", named(lambda k: f"{10 + 0.25 * k:.2f}.png"), "right", "",
        close(pictures(), 0.01)),
    Row("names with a gap in their numbers", named(lambda k: f"{k + 20 * (k > 5):04d}.png"), "told",
        "frames count as evenly spaced in time", close(pictures(), 0.01)),
    Row("two names of one number", named(lambda k: "4.png" if k == 5 else f"{k:04d}.png"), "refused",
        "carry the same frame number"),
    Row("files of the system beside pictures", folder_of(pictures(), change=with_files("clip/._0003.png",
        "clip/.DS_Store", "clip/Thumbs.db")), "right", "",
        close(pictures(), 0.01)),
    Row("masks, 0 and 1", masked([mask(1)] * 12), "right", "", half_excluded),
    Row("masks, 0 and 1 of 16 bit", masked([mask(1).astype(np.uint16)] * 12), "right", "", half_excluded),
    Row("masks, jpg", masked([mask()] * 12, change=lambda folder: rewritten(folder, ending="jpg", quality=40)), "right",
        "", half_excluded),
    Row("masks, classes of instruments", masked([mask(1) + mask(1) * (np.arange(WIDTH) < 20)] * 12), "refused",
        "numbers up to 2 in all pictures"),
    Row("masks, coloured labels", masked([mask()] * 12, change=labels(128, 0, 0)), "refused",
        "one grey channel expected"),
    *(Row(f"depth, {value:g} where there is none", depth(marked(value)), "right", "", hole_is_empty)
      for value in (np.nan, np.inf, -1.0)),
    Row("depth, 1e6 where there is none", depth(marked(1e6)), "refused", "mark pixels without depth"),
    Row("depth, 65535 where there is none", depth(lambda i: marked(65535)(i).astype(np.uint16), kind="png"), "refused",
        "mark pixels without depth"),
    Row("depth, float TIFF", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.float32)).save(path),
        ".tiff"), "right", "", depth_is_true),
    Row("depth, false colours", depth(coloured, kind="png"), "refused", "one grey channel expected"),
    Row("camera in parts of the picture", with_camera("0.78", "1.04", "0.5", "0.5"), "told", "field-of-view"),
    Row("camera in millimetres", with_camera("4.2", "4.2", "64", "48"), "told", "field-of-view"),
    Row("trajectory of more poses than frames", trajectory([f"{i / 25:.2f} 0 0 0 0 0 0 1" for i in range(15)]),
        "refused", "15 poses with times for 12 frames"),
    Row("trajectory of fewer poses than frames", trajectory(POSES[:9]), "refused", "3 of 12 frames have no pose"),
    Row("trajectory that is no number", trajectory([*POSES[:3], "3 nan 0 0 0 0 0 1"]), "refused", "line 4"),
    Row("stereo, a right picture missing", pair(frames=(pictures(), pictures(9))), "refused", "left holds 12 files"),
    Row("stereo, left and right exchanged", exchanged, "refused", "with left and right exchanged"),
    Row("COLMAP, numbered without zeros", colmap_named(lambda k: f"frame{k}.png"), "right", "",
        close(RECONSTRUCTED, 0.01)),
    Row("COLMAP, frames that are not registered", colmap_named(lambda k: f"frame{k + 3 * (k > 5):04d}.png"), "told",
        "frames count as evenly spaced in time", close(RECONSTRUCTED, 0.01)),
    Row("COLMAP, names without an order", colmap_named(lambda k: "overview.png" if k == 5 else f"frame{k}.png"),
        "refused", "numbers in this name: 0"),
    Row("nerfstudio, numbered without zeros", public("nerfstudio", change=renamed("transforms.json",
        "frame_{:05d}.png", lambda k: f"frame_{k + 8}.png", 4, "images/")), "right", "",
        close([public_layouts.picture(i) for i in range(len(public_layouts.poses()))], 0.01)),
]  # fmt: skip
