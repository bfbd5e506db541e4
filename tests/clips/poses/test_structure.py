"""Structure from motion by pycolmap, and `endotsr poses --sfm`.

Tests that call pycolmap are skipped without it. The others give the command a reconstruction that is made from true
poses and depth.
"""

import json
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from moving_clip import (
    hand_held,
    moving_views,
    path_error,
    path_error_up_to_scale,
    poses_of,
    still_views,
    written,
)

import endotsr
from endotsr.cli.main import main
from endotsr.clips.poses import structure
from endotsr.clips.poses.chain import LONGEST_GAP
from endotsr.clips.poses.structure import MISSING, Structure, reconstructed, refuse_too_few
from endotsr.clips.poses.views import IDENTITY, compose, inverse
from endotsr.clips.prepare import make_structure
from endotsr.clips.prepare.make_structure import METHOD, OWN_UNIT, enter_structure
from endotsr.clips.sequences.sequence_file import read_sequence_file
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose

needs_pycolmap = pytest.mark.skipif(
    find_spec("pycolmap") is None, reason="pycolmap is not installed (pip install 'endotsr[sfm]')"
)
SCALE = 50.0  # mm in the unit of the made-up reconstruction


def made_up(views, true, without=()):
    """A reconstruction from true poses and depth: every frame sees points of its own."""
    height, width = views.tissue.shape[1:]
    row, column = (a.ravel() for a in np.mgrid[4:height:9, 4:width:9])
    c, points, seen, pixels, poses = views.camera, [], [], [], []
    for k, pose in enumerate(true):
        known = (views.depth[k][row, column] > 0) & (k not in without)
        z = views.depth[k][row, column][known].astype(np.float64)
        at = np.stack([column, row], axis=1)[known] + 0.5
        x = np.column_stack([z * (at[:, 0] - c.cx) / c.fx, z * (at[:, 1] - c.cy) / c.fy, z])
        relative = compose(pose, inverse(true[0]))
        points.append((x - relative.translation) @ relative.rotation / SCALE)
        seen.append(np.arange(len(x)) + sum(len(rows) for rows in seen))
        pixels.append(at)
        poses.append(None if k in without else CameraPose(relative.rotation, relative.translation / SCALE))
    return Structure(poses, np.concatenate(points), seen, pixels, 0.3, [4])


@pytest.fixture
def reconstruction(monkeypatch):
    """The command gets a made-up reconstruction of the moving clip; its calls are counted."""
    views, true = moving_views()
    found = [made_up(views, true)]
    monkeypatch.setattr(make_structure, "reconstructed", lambda views, on_frame: found[-1])
    monkeypatch.setattr(make_structure, "version", lambda name: "4.2.1")
    return found


def depth_error(folder, views, factor, where=True):
    """The fraction of the pixels that have both depths, and how far the scaled depth is off in the median."""
    depth = endotsr.load_sequence(folder, allow_tissue_fraction=True, depth_percentiles=(0.0, 100.0)).depth
    both = (depth > 0) & (views.depth > 0) & where
    return both.mean(), np.median(np.abs(factor * depth[both] / views.depth[both] - 1))


def test_without_pycolmap_the_extra_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    folder = written(tmp_path / "clip", moving_views()[0], depth=False)
    before = (folder / "sequence.toml").read_bytes()
    assert main(["poses", str(folder), "--sfm"]) == 2
    assert MISSING in capsys.readouterr().err and "pip install 'endotsr[sfm]'" in MISSING
    assert (folder / "sequence.toml").read_bytes() == before and not (folder / "depth").exists()


def test_without_depth_the_option_is_named_and_the_unit_becomes_arbitrary(tmp_path, capsys, reconstruction):
    views, true = moving_views()
    folder = written(tmp_path / "clip", views, depth=False)
    assert main(["poses", str(folder)]) == 2 and "--sfm" in capsys.readouterr().err
    page, data = tmp_path / "page.html", tmp_path / "poses.json"
    assert main(["poses", str(folder), "--sfm", "--html", str(page), "--json", str(data)]) == 0
    said = capsys.readouterr().out
    assert OWN_UNIT in said and "further models of 4 frames" in said and "no length is a measurement" in said
    file = read_sequence_file(folder)
    assert (file.unit, file.depth.unit, file.depth.method) == ("arbitrary", "arbitrary", METHOD)
    assert "structure from motion by pycolmap" in file.poses.origin and OWN_UNIT in file.poses.origin
    found = json.loads(data.read_text("utf-8"))
    assert found["unit"] == "arbitrary unit" and found["scale"] is None and found["other_models"] == [4]
    assert "points of the reconstruction" in page.read_text("utf-8")
    assert main(["poses", str(folder), "--sfm"]) == 2 and "has poses already" in capsys.readouterr().err
    assert main(["poses", str(folder), "--sfm", "--replace"]) == 0
    error, factor = path_error_up_to_scale(poses_of(folder), true)
    assert error < 1e-3
    covered, apart = depth_error(folder, views, factor)
    assert covered > 0.7 and apart < 0.01
    capsys.readouterr()
    assert main(["check", str(folder), "--sequence.allow-tissue-fraction", "--json", str(data)]) == 0
    assert "poses, depth and pictures agree (" in data.read_text("utf-8") and "pose-" not in capsys.readouterr().out


@pytest.mark.parametrize("unit, assumed", [("mm", ""), ("arbitrary", "scale and shift")])
def test_with_depth_the_path_has_its_unit(tmp_path, capsys, reconstruction, unit, assumed):
    views, true = moving_views()
    folder = written(tmp_path / "clip", views, unit=unit, assumed=assumed)
    report = enter_structure(folder)
    assert report.scale.factor == pytest.approx(SCALE, rel=2e-3)
    assert "scaled to the depth of the clip" in read_sequence_file(folder).poses.origin
    file = read_sequence_file(folder)
    assert file.unit == unit and file.depth.method == "given"
    if unit == "mm":
        assert path_error(poses_of(folder), true) < 0.05


def test_depth_of_another_scale_in_every_frame_is_refused(tmp_path, reconstruction):
    views = moving_views()[0]
    factor = np.linspace(1, 1.5, views.count)[:, None, None].astype(np.float32)
    folder = written(
        tmp_path / "clip", views._replace(depth=factor * views.depth), unit="arbitrary", assumed="scale and shift"
    )
    before = (folder / "sequence.toml").read_bytes()
    with pytest.raises(
        InputError, match=r"scale of the path cannot be told.*the limits are 10%, and 50% for the points.*--replace"
    ):
        enter_structure(folder)
    assert (folder / "sequence.toml").read_bytes() == before


def test_an_assumed_plane_gives_way_to_the_depth_of_the_points(tmp_path, reconstruction):
    folder = written(tmp_path / "clip", moving_views()[0], depth=False)
    assert main(["depth", str(folder), "--flat"]) == 0
    assert enter_structure(folder).scale is None
    assert read_sequence_file(folder).depth.method == METHOD and read_sequence_file(folder).depth.assumed == ""


def test_relative_depth_of_a_network_is_fitted_to_the_points(tmp_path, reconstruction):
    """The steps for one moving camera: poses and points, then scale and shift of every frame."""
    views, true = moving_views()
    folder, files = written(tmp_path / "clip", views, depth=False), tmp_path / "network"
    enter_structure(folder)
    files.mkdir()
    for k in range(views.count):
        inverse_depth = np.where(views.depth[k] > 0, 1 / np.maximum(views.depth[k], 1), 0.0)
        np.save(files / f"{k:06d}.npy", (1 + 0.1 * k) * inverse_depth - 0.01 * k)
    assert main(["depth", str(folder), "--given", str(files), "--kind", "relative", "--replace"]) == 0
    file = read_sequence_file(folder)
    assert file.unit == "arbitrary" and file.depth.assumed == "" and "relative inverse depth" in file.depth.method
    factor = path_error_up_to_scale(poses_of(folder), true)[1]
    assert depth_error(folder, views, factor, views.tissue)[1] < 0.01


def test_frames_without_a_pose_are_interpolated_and_named(tmp_path, capsys, reconstruction):
    views, true = moving_views()
    reconstruction.append(made_up(views, true, without=(0, 6)))
    folder = written(tmp_path / "clip", views, depth=False)
    assert main(["poses", str(folder), "--sfm"]) == 0
    said = capsys.readouterr().out
    assert "the pose is interpolated: frame 6" in said and "which is held: frame 0" in said
    assert read_sequence_file(folder).poses.interpolated == [0, 6]
    assert path_error_up_to_scale(poses_of(folder)[1:], true[1:])[0] < 0.5


def test_too_few_registered_frames_are_refused():
    def without(frames, count=20):
        poses = [None if k in frames else IDENTITY for k in range(count)]
        return Structure(poses, np.zeros((0, 3)), [], [], 0.0, [3, 2])

    refuse_too_few(without({3, 7, 11, 15}))
    with pytest.raises(InputError, match=r"15 of 20 frames are registered; further models.* 3, 2 frames; use.*80%"):
        refuse_too_few(without({3, 7, 11, 15, 17}))
    refuse_too_few(without(set(range(10, 10 + LONGEST_GAP)), 60))
    for first in (0, 10, 60 - LONGEST_GAP - 1):
        frames = set(range(first, first + LONGEST_GAP + 1))
        with pytest.raises(InputError, match=f"frames {first} to {first + LONGEST_GAP} have no pose: 9 in a row"):
            refuse_too_few(without(frames, 60))


def test_a_stereo_pair_and_a_folder_that_no_file_names_are_refused(tmp_path, reconstruction):
    views = moving_views()[0]
    for name, match in (("images_right", "a stereo pair gives lengths"), ("depth", "does not name this folder")):
        folder = written(tmp_path / name, views, depth=False)
        (folder / name).mkdir()
        for file in (folder / "images").iterdir():
            (folder / name / file.name).write_bytes(file.read_bytes())
        with pytest.raises(InputError, match=match):
            enter_structure(folder)


def test_with_depth_a_still_scope_is_left_as_it_is(tmp_path, capsys, reconstruction):
    folder = written(tmp_path / "still", still_views())
    assert main(["poses", str(folder), "--sfm"]) == 1 and "still: left as it is" in capsys.readouterr().out


def test_without_depth_a_scope_that_does_not_clearly_move_is_left_as_it_is(tmp_path, capsys, reconstruction):
    """A reconstruction of tissue that moves in front of a still scope is a wrong shape, which explains its flow
    badly."""
    views = still_views()
    reconstruction.append(made_up(views, moving_views()[1]))
    folder = written(tmp_path / "still", views, depth=False)
    before = (folder / "sequence.toml").read_bytes()
    assert main(["poses", str(folder), "--sfm"]) == 1 and "left as it is; --force" in capsys.readouterr().out
    assert (folder / "sequence.toml").read_bytes() == before and not (folder / "depth").exists()
    assert main(["poses", str(folder), "--sfm", "--force"]) == 0 and "motion of the tissue" in capsys.readouterr().out


@needs_pycolmap
@pytest.mark.timeout(900)
def test_the_path_of_a_hand_held_clip_without_depth(tmp_path):
    views, true = hand_held(12)
    folder = written(tmp_path / "clip", views, depth=False)
    report = enter_structure(folder)
    assert report.structure.without == [] and report.structure.error < 1.0
    error, factor = path_error_up_to_scale(poses_of(folder), true)
    assert error < 0.15
    covered, apart = depth_error(folder, views, factor)
    assert covered > 0.5 and apart < 0.02


@needs_pycolmap
@pytest.mark.timeout(900)
def test_masked_pixels_and_frames_are_not_used():
    """A pattern that does not move with the tissue covers half of the picture; three frames are masked whole."""
    views, true = hand_held(12)
    pattern = np.random.default_rng(0).integers(20, 190, (32, 20), dtype=np.uint8).repeat(8, 0).repeat(8, 1)
    images, tissue = views.images.copy(), views.tissue.copy()
    images[:, :, :, 160:], tissue[:, :, 160:], tissue[5:8] = pattern, False, False
    found = reconstructed(views._replace(images=images, tissue=tissue))
    assert found.without == [5, 6, 7]
    for k in range(views.count):
        column, row = np.floor(found.pixels[k]).astype(int).T
        assert tissue[k, row, column].all()
    kept = [k for k in range(views.count) if k not in found.without]
    assert path_error_up_to_scale([found.poses[k] for k in kept], [true[k] for k in kept])[0] < 0.6


@needs_pycolmap
@pytest.mark.timeout(900)
def test_it_repeats_its_result_and_matches_long_clips_by_neighbours(monkeypatch):
    views = hand_held(8)[0]
    first, again = reconstructed(views), reconstructed(views)
    np.testing.assert_array_equal(first.points, again.points)
    for one, other in zip(first.poses, again.poses, strict=True):
        np.testing.assert_array_equal(one.translation, other.translation)
    np.testing.assert_allclose(np.median(np.concatenate([first.depth(k) for k in range(8)])), 1.0)
    monkeypatch.setattr(structure, "EXHAUSTIVE", 4)
    assert reconstructed(views).without == []


@needs_pycolmap
@pytest.mark.timeout(900)
def test_a_still_scope_and_a_cut_are_refused(tmp_path, capsys):
    views = hand_held(12)[0]
    rng = np.random.default_rng(0)
    frozen = np.clip(views.images[:1].astype(int) + rng.integers(-2, 3, (12, *views.images.shape[1:])), 0, 255)
    folder = written(tmp_path / "still", views._replace(images=frozen.astype(np.uint8)), depth=False)
    assert main(["poses", str(folder), "--sfm"]) == 2
    assert "the scope is still, only turns, or shows too little texture" in capsys.readouterr().err
    images = views.images.copy()
    images[6:] = rng.integers(0, 255, images[6:].shape, dtype=np.uint8)
    folder = written(tmp_path / "cut", views._replace(images=images), depth=False)
    assert main(["poses", str(folder), "--sfm"]) == 2
    assert "6 of 12 frames are registered; use at least 80%" in capsys.readouterr().err
    assert "poses" not in (folder / "sequence.toml").read_text("utf-8")
