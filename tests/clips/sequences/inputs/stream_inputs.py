"""Rows of `inputs_tried.py` about public data sets with unusual entries, and about AVI, MPEG streams and BMP."""

import json
import shutil
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import Row, centred, close, converted, folder_of, prepare, public, with_files
from made_videos import pictures
from public_layouts import K
from public_layouts import poses as true_poses
from stream_formats import bitmap, write_avi, write_program, write_transport

from endotsr.clips.sequences.sequence_file import read_sequence_file


def unpacked(change):
    """A keyframe of SCARED with the files of the frames in a folder."""
    return public("scared", "--gaps", "fill", archive=False, change=change)


def one_file_more(raw: Path) -> None:
    pose = {"camera-pose": np.eye(4).tolist()}
    (raw / "data/frame_data/frame_data000007.json").write_text(json.dumps(pose))


def with_calibrations(raw: Path) -> None:
    for file in (raw / "data/frame_data").iterdir():
        stored = json.loads(file.read_text())
        file.write_text(json.dumps(stored | {"camera-calibration": {"KL": K.tolist()}, "timestamp": 1.0}))


def as_downloaded(raw: Path) -> None:
    """The other files of a keyframe."""
    with_files("left_depth_map.tiff", "right_depth_map.tiff", "point_cloud.obj", "Left_Image.png",
               "Right_Image.png")(raw)  # fmt: skip
    (raw / "endoscope_calibration.yaml").rename(raw / "camera_calibration.yaml")


@builder
def true_at(folder: Path, *frames: int) -> bool:
    """The poses of these frames are the true ones."""
    found = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    return all(np.allclose(found[k], true_poses()[k][:3], atol=1e-4) for k in frames)


def other_cameras(raw: Path) -> None:
    for file in (raw / "Rectified_calibration").iterdir():
        stored = json.loads(file.read_text())
        stored["P2"]["data"][0] = 110.0
        file.write_text(json.dumps(stored))


@builder
def stream(folder: Path, write, name: str, **keys) -> list[str]:
    (folder / "v").mkdir()
    write(folder / "v", keys)
    return prepare(f"v/{name}")(folder)


def oblong(folder: Path) -> None:
    converted("bmp")(folder)
    for file in (folder / "clip").iterdir():
        data = bytearray(file.read_bytes())
        data[38:46] = bitmap(38, "<ii", 2000, 1000)[38:46]
        file.write_bytes(data)


FOUR = close(pictures(4))
STREAM_ROWS = [
    Row("SCARED, the file of a frame is missing",
        unpacked(lambda raw: (raw / "data/frame_data/frame_data000001.json").unlink()), "told",
        "1 of 4 frames have no pose", true_at(0, 2, 3)),
    Row("SCARED, a file of no frame", unpacked(one_file_more), "told", "of no frame, not used: frame_data000007.json",
        true_at(0, 1, 2, 3)),
    Row("SCARED, a calibration in every frame", unpacked(with_calibrations), "told",
        "camera-calibration: the calibration of the keyframe is used", true_at(0, 1, 2, 3)),
    Row("SCARED, as downloaded", unpacked(as_downloaded), "told", "left_depth_map.tiff: structured light",
        true_at(0, 1, 2, 3)),
    Row("SERV-CT, P1 and P2 differ", public("servct", change=other_cameras), "refused", "use one camera"),
    Row("Hamlyn, two folders of left pictures", public("hamlyn", "--baseline", "5",
        change=lambda raw: shutil.copytree(raw / "image01", raw / "color")), "told", "not read: image01/", centred),
    Row("pictures, bmp with oblong pixels", folder_of(pictures(4), change=oblong), "told", "the pixels are not square",
        close(pictures(4), 0.01)),
    Row("video, AVI with oblong pixels", stream(write_avi, "a.avi"), "told", "times as wide as high", FOUR),
    Row("video, AVI meant for a part of a window", stream(write_avi, "a.avi", rcFrame=(0, 0, 64, 48)), "told",
        "meant for a part of a window", FOUR),
    Row("video, a scrambled transport stream", stream(write_transport, "a.ts", stream_type=0x1B,
        transport_scrambling_control=2), "refused", "the pictures are encrypted"),
    Row("video, a transport stream with a second view", stream(write_transport, "a.ts", stream_type=0x1B,
        MVC_extension=1), "refused", "a second view of the same pictures is not decoded"),
    Row("video, a scrambled DVD", stream(write_program, "a.mpg", video=True, PES_scrambling_control=1), "refused",
        "the pictures are encrypted"),
]  # fmt: skip
