"""`endotsr poses`: what it writes, what it refuses, and that an interrupted call continues."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from moving_clip import moving_sequence, moving_views, path_error, poses_of, still_views, written

import endotsr
from endotsr.cli.main import main
from endotsr.clips.poses.movement import STILL
from endotsr.clips.poses.views import Views
from endotsr.clips.prepare import make_poses
from endotsr.clips.prepare.make_poses import PARTIAL, PoseProgress, enter_poses
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import with_settings
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose

TRUE = moving_views()[1]


@pytest.fixture
def clip(tmp_path):
    return written(tmp_path / "clip", moving_views()[0])


def continues_as_one_call(clip):
    """The next call removes what an interrupted one left, and has the poses of a call that was not interrupted."""
    found = enter_poses(clip).found
    assert not (clip / PARTIAL).exists()
    whole = enter_poses(clip, replace=True).found
    return all((a.translation == b.translation).all() for a, b in zip(found.cameras, whole.cameras, strict=True))


def test_the_command_writes_poses_with_their_origin(clip, capsys):
    page, data = clip.parent / "page.html", clip.parent / "poses.json"
    assert main(["poses", str(clip), "--html", str(page), "--json", str(data)]) == 0
    said = capsys.readouterr().out
    assert "the scope moves" in said and "no method can tell" in said and "% of the matches agree" in said
    assert f"(median, over {len(TRUE) - 1} frames)" in said, "the clip is shorter than the usual distance"
    assert path_error(poses_of(clip), TRUE) < 0.15
    assert 'origin = "estimated by endotsr poses' in (clip / "sequence.toml").read_text("utf-8")
    found = json.loads(data.read_text("utf-8"))
    assert found["written"] and found["interpolated"] == [] and len(found["poses"]) == len(TRUE)
    assert "position of the scope" in page.read_text("utf-8") and not (clip / PARTIAL).exists()
    assert main(["poses", str(clip)]) == 2 and "has poses already (estimated by" in capsys.readouterr().err
    assert main(["poses", str(clip), "--replace"]) == 0


def test_the_python_interface_gives_the_same_poses(clip):
    """But for the depth, of which a training reads the percentiles 0.1 to 99.8."""
    sequence = endotsr.load_sequence(clip, allow_tissue_fraction=True)
    found = endotsr.estimate_poses(sequence)
    enter_poses(clip)
    for camera, pose in zip(found.cameras, poses_of(clip), strict=True):
        np.testing.assert_allclose(camera.translation, pose.translation, atol=0.05)
    assert not found.static_camera and "poses: estimated" in found.notes[-1]


def test_the_first_camera_keeps_its_pose():
    given = moving_sequence()
    turned = [camera._replace(translation=camera.translation + 5) for camera in given.cameras]
    found = endotsr.estimate_poses(replace(given, cameras=turned))
    np.testing.assert_array_equal(found.cameras[0].translation, turned[0].translation)


def test_a_still_scope_is_left_as_it_is(tmp_path, capsys):
    folder = written(tmp_path / "still", still_views())
    before = (folder / "sequence.toml").read_bytes()
    assert main(["poses", str(folder), "--json", str(tmp_path / "a.json")]) == 1
    assert "still: left as it is" in capsys.readouterr().out
    assert (folder / "sequence.toml").read_bytes() == before
    assert json.loads((tmp_path / "a.json").read_text())["movement"]["answer"] == "still"


def test_with_an_assumed_depth_the_clip_is_left_and_not_called_still(tmp_path, capsys):
    """A plane in place of the depth: a rigid motion leaves more of the flow than it does of a moving scope's."""
    folder = written(tmp_path / "flat", moving_views()[0], depth=False)
    assert main(["depth", str(folder), "--flat"]) == 0
    capsys.readouterr()
    before = (folder / "sequence.toml").read_bytes()
    assert main(["poses", str(folder), "--json", str(tmp_path / "a.json")]) == 1
    assert (folder / "sequence.toml").read_bytes() == before
    said, found = capsys.readouterr().out, json.loads((tmp_path / "a.json").read_text())
    assert found["movement"]["left"] > STILL and found["movement"]["answer"] == "unclear"
    assert "cannot be told, as the depth is assumed (shape)" in said and "still, and" not in said


def test_without_depth_it_says_what_to_run(tmp_path):
    folder = written(tmp_path / "bare", moving_views()[0], depth=False)
    with pytest.raises(InputError, match="no depth, and poses are estimated from it; run endotsr depth"):
        enter_poses(folder)


@pytest.mark.parametrize("after", [1, 9])
def test_an_interrupted_call_continues_with_the_same_result(clip, monkeypatch, after):
    monkeypatch.setattr(make_poses, "KEEP_EVERY", 4)
    steps = [0]

    def stop():
        steps[0] += 1
        if steps[0] == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="the same command continues"):
        enter_poses(clip, watch=PoseProgress(step=stop))
    assert (clip / PARTIAL).is_file() and "poses" not in (clip / "sequence.toml").read_text()
    assert len(json.loads((clip / PARTIAL).read_text())["poses"]) == after + 1
    assert continues_as_one_call(clip)


@pytest.mark.parametrize("text", ["{", '{"clip": "x"}', '{"clip": 1, "poses": [], "links": [], "key": 0, "last": 0}'])
def test_a_damaged_partial_result_is_not_used(clip, text):
    (clip / PARTIAL).write_text(text)
    assert enter_poses(clip).written


def test_windows_that_overlap_have_the_same_poses(clip):
    """`train --windows` reads a range of the frames for each window; all poses come from one estimate."""
    enter_poses(clip)
    whole = endotsr.load_sequence(clip, allow_tissue_fraction=True).cameras
    for first, end in ((0, 9), (5, 14)):
        part = endotsr.load_sequence(clip, allow_tissue_fraction=True, frames=f"{first}:{end}").cameras
        for one, other in zip(part, whole[first:end], strict=True):
            np.testing.assert_array_equal(one.rotation, other.rotation)
            np.testing.assert_array_equal(one.translation, other.translation)


KILLED = """
import os, signal, sys
from pathlib import Path
from endotsr.clips.prepare import make_poses
make_poses.KEEP_EVERY, steps = 2, [0]

def step():
    steps[0] += 1
    if steps[0] == int(sys.argv[2]):
        os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))

make_poses.enter_poses(Path(sys.argv[1]), watch=make_poses.PoseProgress(step=step))
"""


@pytest.mark.parametrize("after", [6, 15], ids=["in the chain", "in the adjustment"])
def test_a_killed_call_leaves_the_clip_and_the_next_one_continues(clip, after):
    before = (clip / "sequence.toml").read_bytes()
    done = subprocess.run([sys.executable, "-c", KILLED, str(clip), str(after)], capture_output=True, check=False)
    assert done.returncode != 0 and (clip / "sequence.toml").read_bytes() == before
    begun = len(json.loads((clip / PARTIAL).read_text("utf-8"))["poses"])
    assert begun == min(after - after % 2, len(TRUE)) and continues_as_one_call(clip)


def test_a_cut_is_named_as_held_frames_or_refused(tmp_path, capsys):
    views, other = moving_views()[0], moving_views(seed=5)[0]
    for count, code, said in (
        (5, 0, "after the last pose, which is held: 5 frames 14, 15, 16"),
        (10, 2, "frames 14 to 23 cannot be registered: 10 in a row"),
    ):
        planes = [np.concatenate([one, two[:count]]) for one, two in zip(views[:3], other[:3], strict=True)]
        assert main(["poses", str(written(tmp_path / f"{count}", Views(*planes, views.camera)))]) == code
        assert said in capsys.readouterr()[1 if code else 0]


def test_equal_frames_are_still(tmp_path, capsys):
    views = moving_views()[0]
    frozen = views._replace(images=views.images[:1].repeat(14, 0), depth=views.depth[:1].repeat(14, 0))
    assert main(["poses", str(written(tmp_path / "frozen", frozen))]) == 1
    assert "the picture moves by 0.0 pixels" in capsys.readouterr().out


def test_one_frame_is_refused_and_two_are_enough(tmp_path, capsys):
    views = moving_views()[0]
    for frames, code, said in ((1, 2, "one frame: there is no motion"), (2, 0, "")):
        few = Views(*(plane[:: 13 // frames][:frames] for plane in views[:3]), views.camera)
        folder = written(tmp_path / str(frames), few)
        assert main(["poses", str(folder), "--force"]) == code and said in capsys.readouterr().err
    assert "[poses]" in (tmp_path / "2" / "sequence.toml").read_text("utf-8")


@pytest.mark.parametrize(("frames", "warned"), [(2, True), (6, True), (7, False)])
def test_up_to_six_frames_get_poses_with_a_warning(frames, warned, tmp_path, capsys):
    """Without --force, though the scope is still: so few frames do not show it."""
    views = still_views()
    folder = written(tmp_path / "clip", Views(*(plane[:frames] for plane in views[:3]), views.camera))
    code, said = main(["poses", str(folder)]), capsys.readouterr().out
    assert ("too few frames match" in said) == ("warning: if the scope is still" in said) == warned
    assert ("[poses]" in (folder / "sequence.toml").read_text("utf-8")) == (code == 0)
    assert code == 0 or not warned


@pytest.mark.parametrize(("width", "height"), [(96, 80), (80, 64)])
def test_small_pictures_are_estimated_and_smaller_ones_are_refused(width, height, tmp_path):
    settings = with_effects(SimulatorSettings(width=width, height=height, frames=14), "camera_motion", "noise")
    path = {"path": "hand", "amplitude": 8.0}
    found = simulate(with_settings(settings, camera_motion=path)).sequence
    folder = written(tmp_path / "clip", Views(found.images, found.masks, found.depth, found.cameras[0]))
    if width < 96:
        with pytest.raises(InputError, match="80x64 pixels are too small to estimate poses from; use at least 96"):
            enter_poses(folder)
        return
    assert enter_poses(folder).written
    true = [CameraPose(camera.rotation, camera.translation) for camera in found.cameras]
    assert path_error(poses_of(folder), true) < 0.5
