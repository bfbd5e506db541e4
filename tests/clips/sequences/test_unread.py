"""Entries that nothing reads: named in the folder of a clip and in the folders of its files, without thumbnails."""

import os
import shutil
from pathlib import Path

import numpy as np
import public_layouts
import pytest
import raw_sources
from common_folder import written
from dataset_inputs import rig
from made_videos import files, pictures

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.layouts import describe, describe_for_training
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.config import SequenceConfig

PLANTED = ("calibration.xml", "poses.txt")
NOISE = (".DS_Store", "._0001.png", "Thumbs.db", "readme.txt", "@eaDir/a.jpg")


def planted(folder: Path) -> Path:
    """The folder with entries that nothing reads, and with those that every folder may have."""
    for name in (*PLANTED, *NOISE):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("1")
    return folder


def pairs(folder: Path) -> None:
    for side in ("left", "right"):
        files(folder, side, pictures(3))
    (folder / "left/times.txt").write_text("0\n0.04\n0.08\n")


def euroc(folder: Path) -> None:
    made = folder.parent / "made"
    made.mkdir()
    rig(second=True)(made)
    (made / "raw").rename(folder)


def two_videos(folder: Path) -> None:
    folder.mkdir()
    for side in ("left", "right"):
        raw_sources.write_video(folder / f"{side}.mkv", pictures(3))


# For each layout: how its folder is made, and its folders from which files are read.
LAYOUTS = {
    "pictures": (pairs, (".", "left")),
    "video": (two_videos, (".",)),
    "euroc": (euroc, (".", "mav0", "mav0/cam0", "mav0/cam0/data", "mav0/cam1/data")),
    "scared": (lambda folder: public_layouts.scared(folder, archive=False), (".", "data", "data/frame_data")),
    "hamlyn": (public_layouts.hamlyn, (".", "image01", "image02", "depth01")),
    "servct": (public_layouts.servct, (".", "Left_rectified", "Rectified_calibration", "Ground_truth_CT/DepthL")),
    "c3vd": (public_layouts.c3vd, (".",)),
    "nerfstudio": (public_layouts.nerfstudio, (".", "images", "masks", "depth")),
    "colmap": (lambda folder: raw_sources.colmap(folder, False), (".", "images", "sparse", "sparse/0")),
    "tum": (raw_sources.tum, (".", "rgb", "depth")),
    "stereomis": (raw_sources.stereomis, (".", "masks")),
}


def said(notes) -> list[str]:
    return [note for note in notes if "not read: " in note]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_entries_of_every_folder_of_a_layout_are_named(layout, tmp_path):
    make, folders = LAYOUTS[layout]
    path = tmp_path / "clip"
    make(path)
    before = describe(path)
    assert before.layout == layout and said(before.notes) == []
    for name in folders:
        planted(path / name)
    found = said(describe(path).notes)
    assert [note.split(": not read")[0] for note in found] == ["clip", *sorted(folders[1:])]
    for note in found:
        assert note.split(": not read: ")[1].split(";")[0] == ", ".join(PLANTED), note


def test_those_of_a_folder_for_training_are_named(tmp_path):
    written(tmp_path / "clip")
    assert describe_for_training(tmp_path / "clip", SequenceConfig()).not_read == ()
    for name in ("images", "masks", "depth"):
        planted(tmp_path / "clip" / name)
    np.save(tmp_path / "clip/images/0.npy", np.zeros(3))
    (tmp_path / "clip/images/old").mkdir()
    (tmp_path / "clip/images/old/0.png").write_bytes(b"")
    depth, images, masks = describe_for_training(tmp_path / "clip", SequenceConfig()).not_read
    assert depth == "depth: not read: calibration.xml, poses.txt"
    assert images == "images: not read: 0.npy, calibration.xml, old/, poses.txt"
    assert masks == "masks: not read: calibration.xml, poses.txt"


def test_those_of_stated_folders_are_named_and_many_are_counted(tmp_path):
    pairs(tmp_path / "clip")
    shutil.copytree(tmp_path / "clip/left", tmp_path / "m")
    for k in range(4):
        (tmp_path / "m" / f"{k}.json").write_text("{}")
    notes = describe(tmp_path / "clip", SourceOptions(masks=tmp_path / "m")).notes
    assert said(notes) == ["m: not read: times.txt, 4 files .json"]


def test_a_name_that_looks_like_a_pattern_is_read(tmp_path):
    for k in range(3):
        write_png(tmp_path / f"clip [{k}].png", np.full((48, 64, 3), 40 * k + 40, np.uint8))
    assert said(describe(tmp_path).notes) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize(
    "make", [getattr(os, "mkfifo", None), lambda path: path.symlink_to("nowhere")], ids=["pipe", "dangling link"]
)
def test_a_list_of_times_that_is_no_regular_file_is_named(make, tmp_path):
    folder = tmp_path / "clip"
    files(tmp_path, "clip", pictures(3))
    make(folder / "times.csv")
    clip = describe(folder, SourceOptions())
    assert any("not read: times.csv" in note for note in clip.notes), clip.notes
