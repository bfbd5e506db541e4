"""The truth in files: what is read is the truth in memory, and damaged files are refused by name and key."""

import json
import shutil

import numpy as np
import pytest

from endotsr.clips.simulator import EFFECTS, SimulatorSettings, material_tracks, simulate, with_effects
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.frames import make_scene
from endotsr.clips.simulator.gain import camera_gain
from endotsr.clips.simulator.shading import lit_by_all, shade
from endotsr.clips.simulator.truth import read_truth
from endotsr.clips.simulator.views import see
from endotsr.errors import InputError

SETTINGS = with_effects(SimulatorSettings(width=48, height=40, frames=7, seed=3), *EFFECTS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene")
    write_sequence(path, SETTINGS, "everything")
    return path


@pytest.fixture(scope="module")
def memory():
    return simulate(SETTINGS)


def test_frames_are_those_in_memory(folder, memory):
    truth = read_truth(folder)
    assert truth.scene == "everything" and truth.settings == SETTINGS and truth.noise_sigma == SETTINGS.noise.sigma
    for i in (0, 6):
        frame = truth.frame(i)
        np.testing.assert_array_equal(frame.depth, memory.truth.depth[i].astype(np.float32))
        np.testing.assert_array_equal(frame.material, memory.truth.material_coordinates[i].astype(np.float32))
        np.testing.assert_array_equal(frame.instrument, memory.truth.instrument[i])
        assert (frame.highlight >= 0).all() and frame.highlight.max() > 0.05
    with pytest.raises(IndexError, match="frame 7 of a scene of 7"):
        truth.frame(7)


def test_tracks_are_those_in_memory(folder, memory):
    truth = read_truth(folder)
    expected = material_tracks(memory, truth.tracks.material)
    for name, array in expected._asdict().items():
        np.testing.assert_array_equal(getattr(truth.tracks, name), array)
    assert truth.tracks.material.shape == (2, 24 * 19) and 0.3 < truth.tracks.visible.mean() < 1


def test_gain_and_its_content(folder):
    truth = read_truth(folder)
    np.testing.assert_array_equal(truth.gain, [camera_gain(SETTINGS, t) for t in truth.times])
    angle = 2 * np.pi * truth.spectrum.cycles * truth.times[:, None]
    total = np.cos(angle) @ truth.spectrum.cosine + np.sin(angle) @ truth.spectrum.sine
    np.testing.assert_allclose(total, truth.gain, atol=1e-14)


def test_the_light_of_a_track_is_that_of_the_picture_without_highlights():
    """The light at tracked points against the light of the frame at their pixels, interpolated."""
    effects = ("breathing", "brightening", "bleeding", "second_light")
    settings = with_effects(SimulatorSettings(width=80, height=64, frames=4, seed=3, focal=1.8), *effects, "highlights")
    from endotsr.clips.simulator.folder import tissue_light, tracked_points

    scene = make_scene(settings)
    material = tracked_points(scene)
    found = tissue_light(scene, material, 2)
    matte = with_effects(settings, *effects)
    view = see(scene.surface, scene.cameras[2], 0.5)
    light = shade(matte, scene.texture, view, lit_by_all(matte, view, scene.cameras[2]), 0.5).light
    tracks = material_tracks(simulate(settings), material)
    column, row = np.floor(tracks.pixel[2]).astype(int)
    seen = tracks.visible[2]
    difference = light[:, row[seen], column[seen]] - found[:, seen]
    assert np.abs(difference).mean() < 0.02 < found.std()


@pytest.fixture
def copy(folder, tmp_path):
    shutil.copytree(folder / "truth", tmp_path / "truth")
    return tmp_path


def rewrite(path, **changes):
    with np.load(path) as file:
        arrays = dict(file)
    np.savez(path, **{k: v for k, v in (arrays | changes).items() if v is not None})


@pytest.mark.parametrize(
    ("file", "changes", "message"),
    [
        ("light.npz", {"gain": None}, "light.npz: gain is missing"),
        ("light.npz", {"gain": np.ones((7, 4))}, r"gain is float64 of shape \(7, 4\); use real numbers, \(7, 3\)"),
        ("light.npz", {"times": np.array(["a"] * 7)}, "times: <U1"),
        ("light.npz", {"noise_sigma": np.array(np.nan)}, "noise_sigma holds a number that is not finite"),
        ("tracks.npz", {"visible": np.ones((7, 456))}, "visible is float64 .* use true or false"),
        ("tracks.npz", {"pixel": np.zeros((7, 2, 3))}, r"pixel is float64 of shape \(7, 2, 3\)"),
        ("tracks.npz", {"depth": np.full((7, 456), np.inf)}, "depth holds a number that is not finite"),
        ("tracks.npz", {"light": np.array([object()])}, r"tracks.npz: light: it holds Python objects"),
    ],
)
def test_a_damaged_archive_is_refused(copy, file, changes, message):
    rewrite(copy / "truth" / file, **changes)
    with pytest.raises(InputError, match=message) as caught:
        read_truth(copy)
    assert "\n" not in str(caught.value)


def test_damaged_frames_are_refused(copy):
    truth = read_truth(copy)
    frames = copy / "truth" / "frames"
    rewrite(frames / "000001.npz", depth=np.zeros((3, 3), np.float32))
    (frames / "000002.npz").write_bytes(b"no archive")
    (frames / "000003.npz").unlink()
    (frames / "000004.npz").write_bytes((frames / "000000.npz").read_bytes()[:900])
    shutil.copy(frames / "000000.npz", copy / "truth" / "instrument" / "000005.png")
    for i, message in (
        (1, r"000001.npz: depth is float32 of shape \(3, 3\); use real numbers, \(40, 48\)"),
        (2, "000002.npz: not an .npz file"),
        (3, "000003.npz: cannot be read: No such file"),
        (4, "000004.npz: not an .npz file, or cut short"),
        (5, "000005.png: not a PNG"),
    ):
        with pytest.raises(InputError, match=message):
            truth.frame(i)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data | {"format": 2}, "truth.json: format = 2 is not allowed; use 1"),
        (lambda data: {"format": 1}, "truth.json: settings is missing"),
        (lambda data: [1], "truth.json: holds list; use an object"),
        (lambda data: data | {"settings": data["settings"] | {"width": 3}}, "settings.width = 3 is not allowed"),
        (lambda data: data | {"settings": data["settings"] | {"fog": {}}}, "fog"),
    ],
)
def test_a_damaged_record_is_refused(copy, change, message):
    path = copy / "truth" / "truth.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(InputError, match=message):
        read_truth(copy)


def test_a_folder_without_truth_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"truth.json: file not found; use a sequence folder that `endotsr simul"):
        read_truth(tmp_path)
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "truth.json").write_text("{")
    with pytest.raises(InputError, match=r"truth.json: cannot be read"):
        read_truth(tmp_path)
