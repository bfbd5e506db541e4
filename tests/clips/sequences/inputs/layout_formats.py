"""Folders of public data sets, and a change of each of their files and fields that is used.

The keys of a folder are the names of its entries, in lower case. Their value is 0 for the entry as it is made, 1 for
another content, or None for an entry that is left out. An entry that is not made is added.
"""

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import public_layouts
from field_formats import Format, Keys, result

from endotsr.clips.sequences.layouts import c3vd, describe, hamlyn, scared, servct
from endotsr.clips.sequences.source_options import SourceOptions

MOVED = np.eye(4)
MOVED[0, 3] = 7.0
LENS = np.column_stack([public_layouts.K, np.zeros(3)])
RIGHT = LENS - np.array([[0, 0, 0, 500.0], [0] * 4, [0] * 4])


def told(folder: Path) -> object:
    """What the source says with its right pictures, and its notes."""
    clip = describe(folder / "x", SourceOptions(layout="auto"))
    right = next(clip.pictures([0])).right
    notes = [note.replace(str(folder), "").removeprefix("x: ") for note in clip.notes]
    return (result(clip), None if right is None else right.tobytes(), clip.calibration and str(clip.calibration)), notes


def change(path: Path) -> None:
    """Another content: pictures are shifted, cameras have another focal length, poses are moved."""
    for file in [path] if path.is_file() else sorted(found for found in path.rglob("*") if found.is_file()):
        if file.name == "pose.txt":
            file.write_text(",".join(map(str, MOVED.T.ravel())) + "\n")
        elif file.name.startswith("frame_data"):
            file.write_text(json.dumps({"camera-pose": MOVED.tolist()}))
        elif file.suffix in (".json", ".yaml", ".txt"):
            file.write_text(file.read_text().replace("100.0", "103.0").replace("100.,", "103.,"))
        elif file.suffix != ".mp4":
            cv2.imwrite(str(file), np.roll(cv2.imread(str(file), cv2.IMREAD_UNCHANGED), 5, axis=1))


def entries(make: Callable[[Path], None]) -> Callable[[Path, Keys], None]:
    """A writer of the folder with changed, missing and further entries."""

    def write(folder: Path, keys: Keys) -> None:
        make(folder / "x")
        for name, value in keys.items():
            place = next((path for path in (folder / "x").iterdir() if path.name.lower() == name), folder / "x" / name)
            if value is None:
                shutil.rmtree(place) if place.is_dir() else place.unlink()
            elif not place.exists():
                file = place if place.suffix else place / "0.png"
                file.parent.mkdir(exist_ok=True)
                file.write_text("1")
            elif value:
                change(place)

    return write


def write_servct_camera(folder: Path, keys: Keys) -> None:
    """The files of the cameras have these keys."""
    public_layouts.servct(folder / "x")
    stored = {name: {"data": np.ravel(value).tolist()} for name, value in keys.items() if value is not None}
    for file in (folder / "x/Rectified_calibration").iterdir():
        file.write_text(json.dumps(stored))


def write_scared_frame(folder: Path, keys: Keys) -> None:
    """The file of the second frame has these keys."""
    public_layouts.scared(folder / "x", archive=False)
    stored = {name: value for name, value in keys.items() if value is not None}
    (folder / "x/data/frame_data/frame_data000001.json").write_text(json.dumps(stored))


def layout(inventory, make: Callable[[Path], None], names: str, named: str = "") -> Format:
    """Each of these entries changes what is read; each of the others is named in a note."""
    used = names.split()
    return Format(inventory, dict.fromkeys(used, 0), entries(make), told, dict.fromkeys(used, 1), {},
                  dict.fromkeys(named.split(), 0))  # fmt: skip


LAYOUTS = {
    "servct": layout(servct.FILES, public_layouts.servct,
                     "left_rectified right_rectified rectified_calibration ground_truth_ct",
                     "left right reference_rgb"),
    "servct camera": Format(servct.CAMERA, {"P1": LENS, "P2": RIGHT}, write_servct_camera, told,
                            {"P1": LENS * [[2.0], [1], [1]], "P2": RIGHT * [1.0, 1, 1, 2]}, {}),
    "hamlyn": layout(hamlyn.FILES, partial(public_layouts.hamlyn, names=("color", "image02", "depth"), columns=3),
                     "color image02 depth intrinsics.txt"),
    "c3vd": layout(c3vd.FILES, partial(public_layouts.c3vd, frames=1), "0_color.png 0000_depth.tiff pose.txt"),
    "scared": layout(scared.FILES, partial(public_layouts.scared, archive=False), "endoscope_calibration.yaml data",
                     "left_depth_map.tiff point_cloud.obj"),
    "scared frame": Format(scared.FRAME, {"camera-pose": np.eye(4).tolist()}, write_scared_frame, told,
                           {"camera-pose": MOVED.tolist()}, {}, {"camera-calibration": {"KL": [1.0]}}),
}  # fmt: skip
# The other name of an entry; one of the two is read.
OTHER_NAMES = {"hamlyn": {"image01", "depth01"}, "scared": {"camera_calibration.yaml"}}
