"""What a layout takes for all frames, leaves over or replaces has a note, and a file that it cannot take is refused."""

import json

import numpy as np
import public_layouts as made
import pytest
import raw_sources as raw

from endotsr.clips.sequences.layouts import describe, scared
from endotsr.clips.sequences.layouts.scared import frame_texts
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.errors import InputError

DEPTH = {
    "hamlyn": (lambda folder: made.hamlyn(folder, ("color", "depth")), "depth/*.png"),
    "servct": (made.servct, "Ground_truth_CT/DepthL/*.png"),
    "c3vd": (made.c3vd, "*_depth.tiff"),
    "stereomis": (raw.stereomis, "masks/*.png"),
}


@pytest.mark.parametrize("layout", DEPTH)
def test_a_single_file_for_all_frames_is_noted(layout, tmp_path):
    make, pattern = DEPTH[layout]
    make(tmp_path / "raw")
    first, *others = sorted((tmp_path / "raw").glob(pattern))
    assert not any("taken for all" in note for note in describe(tmp_path / "raw").notes)
    for file in others:
        file.unlink()
    clip = describe(tmp_path / "raw")
    assert f"{first.name}: taken for all {clip.count} frames" in clip.notes


@pytest.mark.parametrize("layout", DEPTH)
def test_a_file_of_no_frame_is_noted(layout, tmp_path):
    make, pattern = DEPTH[layout]
    make(tmp_path / "raw")
    first = min((tmp_path / "raw").glob(pattern))
    digits = "".join(filter(str.isdigit, first.name.split("_")[0]))
    other = first.with_name(first.name.replace(digits, "9" * len(digits), 1))
    other.write_bytes(first.read_bytes())
    notes = describe(tmp_path / "raw").notes
    assert any(f"belonging to no frame, not used: {other.name}" in note for note in notes), notes


def test_files_of_stereomis_that_an_option_replaces_are_noted(tmp_path):
    raw.stereomis(tmp_path / "raw")
    for name in ("StereoCalibration.ini", "groundtruth.txt"):
        (tmp_path / name).write_bytes((tmp_path / "raw" / name).read_bytes())
    options = SourceOptions(
        calibration=tmp_path / "StereoCalibration.ini", trajectory=tmp_path / "groundtruth.txt",
        masks=tmp_path / "raw/masks", excluded_value="black",
    )  # fmt: skip
    notes = describe(tmp_path / "raw", options).notes
    assert "StereoCalibration.ini: not read, because --calibration is stated" in notes
    assert "groundtruth.txt: not read, because --trajectory is stated" in notes
    assert not any(note.startswith("masks: not read") for note in notes)  # the same folder, which is read


OWN = {  # layouts with masks or depth of their own: the option, the files that it states, and the part that it replaces
    "nerfstudio": (made.nerfstudio, "masks", "raw/masks", "mask_path"),
    "tum": (raw.tum, "depth", "raw/depth", "depth.txt"),
    "hamlyn": (lambda folder: made.hamlyn(folder, ("color", "depth")), "depth", "raw/depth", "depth of the source"),
}


@pytest.mark.parametrize("layout", OWN)
def test_masks_or_depth_that_an_option_replaces_are_noted(layout, tmp_path):
    make, option, folder, part = OWN[layout]
    make(tmp_path / "raw")
    note = f"{part}: not read, because --{option} is stated"
    assert note not in describe(tmp_path / "raw").notes
    assert note in describe(tmp_path / "raw", SourceOptions(**{option: tmp_path / folder})).notes


def test_what_a_trajectory_of_tum_says_about_itself_is_noted(tmp_path):
    raw.tum(tmp_path / "raw")
    path = tmp_path / "raw/groundtruth.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[1:], lines[0]]) + "\n")
    clip = describe(tmp_path / "raw")
    assert any("stamps go back" in note for note in clip.notes), clip.notes
    assert clip.poses is not None and all(clip.poses)


@pytest.mark.parametrize("archive", [True, False])
def test_a_pose_of_scared_that_is_too_large_is_refused(archive, tmp_path):
    """Passed over, it would shift the frames of all poses behind it, or leave one frame without a pose."""
    texts = {f"frame_data{i:06d}.json": json.dumps({"camera-pose": np.eye(4).tolist()}) for i in range(4)}
    texts["frame_data000001.json"] += " " * scared.LARGEST_FILE
    made.frame_data(tmp_path, texts, archive)
    with pytest.raises(InputError, match=r"frame_data000001.json"):
        frame_texts(tmp_path)


def test_two_poses_of_scared_with_one_name_are_refused(tmp_path):
    made.frame_data(tmp_path, {"a/frame_data000000.json": "{}", "b/frame_data000000.json": "{}"}, True)
    with pytest.raises(InputError, match=r"b/frame_data000000.json: two files have this name"):
        frame_texts(tmp_path)


@pytest.mark.parametrize("archive", [True, False])
def test_more_poses_of_scared_than_frames_are_refused(archive, tmp_path, monkeypatch):
    monkeypatch.setattr(scared, "MOST_FILES", 2)
    made.frame_data(tmp_path, {f"frame_data{i:06d}.json": "{}" for i in range(3)}, archive)
    with pytest.raises(InputError, match=r"more than 2 files"):
        frame_texts(tmp_path)


def test_a_video_of_stereomis_with_another_ending_counts_as_read(tmp_path):
    raw.stereomis(tmp_path / "raw")
    next((tmp_path / "raw").glob("*.mp4")).unlink()
    pictures = [np.concatenate([raw.scene_picture(i)] * 2) for i in range(6)]
    raw.write_video(tmp_path / "raw/stereo.avi", pictures)
    clip = describe(tmp_path / "raw")
    assert clip.count == 6 and not any("not read" in note for note in clip.notes), clip.notes
