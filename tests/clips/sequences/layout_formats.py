"""Small folders of public data sets, and a change of each of their files and fields that is used.

The keys of a folder are the names of its entries, in lower case. Their value is a seed: 0, another number for another
content, or None for an entry that is left out.
"""

import json
from pathlib import Path

import numpy as np
import public_layouts
from field_inputs import Format, Keys, result

from endotsr.clips.opencv import write_png
from endotsr.clips.sequences.layouts import c3vd, describe, hamlyn, scared, servct
from endotsr.clips.sequences.source_options import SourceOptions

WIDTH, HEIGHT = 32, 24
LENS = np.array([[30.0, 0, 15.5, 0], [0, 31, 11.5, 0], [0, 0, 1, 0]])
RIGHT = LENS - np.array([[0, 0, 0, 150.0], [0] * 4, [0] * 4])


def told(folder: Path) -> object:
    """What the source says with its right pictures, and its notes."""
    clip = describe(folder / "x", SourceOptions(layout="auto"))
    right = next(clip.pictures([0])).right
    notes = [note.replace(str(folder), "").removeprefix("x: ") for note in clip.notes]
    return (result(clip), None if right is None else right.tobytes(), clip.calibration and str(clip.calibration)), notes


def planes(folder: Path, seed: int, count: int = 2, depth: bool = False, ending: str = "") -> None:
    """Pictures, or depth, of two frames."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    for i in range(count):
        pixels = rng.integers(1, 250, (HEIGHT, WIDTH) if depth else (HEIGHT, WIDTH, 3))
        write_png(folder / f"{i + 1:03d}{ending}.png", pixels.astype(np.uint16 if depth else np.uint8))


def camera_file(folder: Path, keys: Keys) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    stored = {name: {"data": np.ravel(value).tolist()} for name, value in keys.items() if value is not None}
    for i in range(2):
        (folder / f"{i + 1:03d}.json").write_text(json.dumps(stored))


def write_servct(folder: Path, keys: Keys) -> None:
    """An experiment of SERV-CT whose entries have these seeds."""
    raw = folder / "x"
    raw.mkdir()
    for name, seed in keys.items():
        if seed is None:
            continue
        if name == "rectified_calibration":
            camera_file(raw / "Rectified_calibration", {"P1": LENS, "P2": RIGHT + np.eye(3, 4, 3) * -seed})
        elif name == "ground_truth_ct":
            planes(raw / "Ground_truth_CT/DepthL", seed, depth=True)
        else:
            planes(
                raw / {"left_rectified": "Left_rectified", "right_rectified": "Right_rectified"}.get(name, name), seed
            )


def write_servct_camera(folder: Path, keys: Keys) -> None:
    write_servct(folder, {"left_rectified": 0, "right_rectified": 1})
    camera_file(folder / "x/Rectified_calibration", keys)


def write_hamlyn(folder: Path, keys: Keys) -> None:
    raw = folder / "x"
    raw.mkdir()
    for name, seed in keys.items():
        if seed is None:
            continue
        if name == "intrinsics.txt":
            lens = LENS[:, :3] + np.array([[seed, 0, 0], [0, 0, 0], [0, 0, 0]])
            (raw / name).write_text("\n".join(" ".join(map(str, row)) for row in lens))
        else:
            planes(raw / name, seed, depth=name.startswith("depth"))


def write_c3vd(folder: Path, keys: Keys) -> None:
    """A sequence of one frame."""
    import cv2

    raw = folder / "x"
    raw.mkdir()
    for name, seed in keys.items():
        if seed is None:
            continue
        if name == "pose.txt":
            pose = np.eye(4)
            pose[3, 0] = seed
            (raw / name).write_text(",".join(map(str, pose.ravel())))
        elif name.endswith("_color.png"):
            write_png(raw / name, np.full((1080, 1350, 3), 90 + seed, np.uint8))
        else:
            cv2.imwrite(str(raw / name), np.full((1080, 1350), 30000 + seed, np.uint16))


def write_scared(folder: Path, keys: Keys) -> None:
    """A keyframe of SCARED; a seed changes its calibration, or the poses."""
    raw = folder / "x"
    public_layouts.scared(raw, archive=False)
    for name, seed in keys.items():
        if name == "endoscope_calibration.yaml":
            text = (raw / name).read_text()
            (raw / name).write_text(text.replace("100.", f"{100 + seed}.") if seed is not None else text)
            if seed is None:
                (raw / name).unlink()
        elif name == "data" and seed:
            frames = raw / "data/frame_data"
            for file in frames.iterdir():
                file.write_text(json.dumps({"camera-pose": np.eye(4).tolist()}))
        elif name not in ("data",) and seed is not None:
            (raw / name).write_text("1")


def write_scared_frame(folder: Path, keys: Keys) -> None:
    """The file of the second frame has these keys."""
    write_scared(folder, {})
    stored = {name: value for name, value in keys.items() if value is not None}
    (folder / "x/data/frame_data/frame_data000001.json").write_text(json.dumps(stored))


MOVED = np.eye(4)
MOVED[0, 3] = 7.0
SERVCT = {"left_rectified": 0, "right_rectified": 1, "rectified_calibration": 0, "ground_truth_ct": 2}
HAMLYN = {"color": 0, "image02": 1, "depth": 2, "intrinsics.txt": 0}
C3VD = {"0_color.png": 0, "0000_depth.tiff": 0, "pose.txt": 0}
LAYOUTS = {
    "servct": Format(servct.FILES, SERVCT, write_servct, told, {name: 9 for name in SERVCT}, {},
                     {"left": 3, "right": 3, "reference_rgb": 3}),
    "servct camera": Format(servct.CAMERA, {"P1": LENS, "P2": RIGHT}, write_servct_camera, told,
                            {"P1": LENS * [[2.0], [1], [1]], "P2": RIGHT * [1.0, 1, 1, 2]}, {}),
    "hamlyn": Format(hamlyn.FILES, HAMLYN, write_hamlyn, told, {name: 9 for name in HAMLYN}, {}),
    "c3vd": Format(c3vd.FILES, C3VD, write_c3vd, told, {name: 9 for name in C3VD}, {}),
    "scared": Format(scared.FILES, {"endoscope_calibration.yaml": 0, "data": 0}, write_scared, told,
                     {"endoscope_calibration.yaml": 3, "data": 1}, {}, {"left_depth_map.tiff": 1,
                      "point_cloud.obj": 1}),
    "scared frame": Format(scared.FRAME, {"camera-pose": np.eye(4).tolist()}, write_scared_frame, told,
                           {"camera-pose": MOVED.tolist()}, {}, {"camera-calibration": {"KL": [1.0]}}),
}  # fmt: skip
# The other name of an entry; one of the two is read.
OTHER_NAMES = {"hamlyn": {"image01", "depth01"}, "scared": {"camera_calibration.yaml"}}
