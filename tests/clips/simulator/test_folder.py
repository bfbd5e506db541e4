"""A scene in files: the reader takes it as it is, it equals the scene in memory, and so does the training from it."""

import hashlib

import msgspec
import numpy as np
import pytest

from endotsr.api import train
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.depth_files import clip_depth
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.field_of_view import check_field_of_view
from endotsr.clips.simulator.folder import check_scene, write_sequence
from endotsr.clips.simulator.scenes import IN_FILES, SCENES, effects_on, named_scene, scene_of
from endotsr.config import SequenceConfig, with_settings
from endotsr.errors import InputError

SMALL = {"width": 48, "height": 40, "frames": 6, "focal": 1.2}
EXACT = SequenceConfig(depth_percentiles=(0.0, 100.0))


def small(name):
    return msgspec.structs.replace(named_scene(name), **SMALL)


@pytest.fixture(scope="module", params=SCENES)
def written(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    write_sequence(folder, small(request.param), request.param)
    return request.param, folder, simulate(small(request.param))


def test_every_scene_is_read_as_it_is_and_equals_the_one_in_memory(written):
    _, folder, simulated = written
    back, here = read_sequence(folder, EXACT), simulated.sequence
    for array in ("images", "masks", "depth", "times", "train_index", "test_index"):
        np.testing.assert_array_equal(getattr(back, array), getattr(here, array))
    assert back.static_camera == here.static_camera
    for one, other in zip(back.cameras, here.cameras):
        for a, b in zip(one, other):
            np.testing.assert_array_equal(a, b)


def test_the_usual_clip_of_the_reader_is_the_only_difference(written):
    _, folder, simulated = written
    config = SequenceConfig()
    back, here = read_sequence(folder, config), simulated.sequence
    clipped = np.stack([clip_depth(frame, config.depth_percentiles) for frame in here.depth])
    np.testing.assert_array_equal(back.depth, clipped)
    assert not any("tissue" in note and "flag" in note for note in back.notes)


def test_masks_exclude_instruments_and_what_has_no_depth(written):
    _, folder, simulated = written
    for i in (0, 4):
        mask, own = (read_png(folder / part / f"{i:06d}.png") for part in ("masks", "gt_masks"))
        depth = read_png(folder / "depth" / f"{i:06d}.png")
        assert depth.dtype == np.uint16 and ((depth > 0) == (mask == 0)).all()
        assert (own[simulated.truth.instrument[i]] == 255).all() and (mask[own == 255] == 255).all()
        assert read_png(folder / "images_right" / f"{i:06d}.png").shape == (40, 48, 3)


def test_a_folder_is_repeatable_to_the_last_bit(tmp_path, written):
    name, folder, _ = written
    if name != "everything":
        pytest.skip("one scene with all effects is enough")
    write_sequence(tmp_path, small(name), name)
    files = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert len(files) == 6 * 7 + 4
    for file in files:
        first, second = (hashlib.sha256((root / file).read_bytes()).hexdigest() for root in (folder, tmp_path))
        assert first == second, file


TINY = {
    "training": {"iterations": 12, "residual_activation": 4, "threads": 1},
    "initialisation": {"first_frame_points": 120, "other_frame_points": 30},
    "density": {"start": 2, "interval": 3, "until": 11},
}


@pytest.mark.parametrize("name", ["moving-camera", "pulling"])
def test_training_from_files_equals_training_in_memory(tmp_path, name):
    write_sequence(tmp_path, small(name))
    runs = [train(sequence, **TINY) for sequence in (read_sequence(tmp_path, EXACT), simulate(small(name)).sequence)]
    first, second = (run.render(time=0.4) for run in runs)
    np.testing.assert_array_equal(first.colour, second.colour)
    np.testing.assert_array_equal(first.depth, second.depth)
    assert first.colour.std() > 0.01


def test_names_of_scenes_and_effects():
    assert effects_on(named_scene("still")) == ("noise", *IN_FILES)
    assert scene_of("breathing, smoke").smoke.on and effects_on(scene_of("")) == IN_FILES
    size = named_scene("everything")
    assert (size.width, size.height, size.frames) == (640, 512, 63)
    with pytest.raises(InputError, match="scene 'stil' is not allowed; use one of still, breathing, pulling"):
        named_scene("stil")
    with pytest.raises(InputError, match="effects: unknown: fog; use one of breathing"):
        scene_of("breathing,fog")


@pytest.mark.parametrize("name", SCENES)
def test_the_named_scenes_stay_in_the_picture(name):
    check_scene(named_scene(name))


@pytest.mark.parametrize(("name", "section", "key", "value"), [
    ("breathing", "breathing", "amplitude", 80.0), ("breathing", "pulsation", "amplitude", 90.0),
    ("pulling", "pull", "amplitude", 80.0), ("pulling", "instrument", "travel", 0.5),
    ("cutting", "cutting", "length", 80.0), ("cutting", "bleeding", "radius", 30.0),
    ("moving-camera", "camera_motion", "amplitude", 60.0),
])  # fmt: skip
def test_what_leaves_the_field_of_view_is_refused_with_the_largest_allowed_value(name, section, key, value):
    settings = small(name)
    with pytest.raises(InputError, match=rf"{section}.{key} = {value:g} leaves .* use at most") as caught:
        check_field_of_view(with_settings(settings, **{section: {key: value}}))
    largest = float(str(caught.value).rsplit(" ", 1)[1])
    check_field_of_view(with_settings(settings, **{section: {key: largest}}))
    with pytest.raises(InputError):
        check_field_of_view(with_settings(settings, **{section: {key: largest + 0.02}}))


def test_what_a_folder_cannot_hold_is_refused():
    still = small("still")
    with pytest.raises(InputError, match=r"depth_rounding.step = 0.5 does not fit .* use 1, 2, 3"):
        check_scene(with_settings(still, depth_rounding={"step": 0.5}))
    with pytest.raises(InputError, match=r"depth_rounding.on = False"):
        check_scene(with_effects(SimulatorSettings(**SMALL), "stereo"))
    with pytest.raises(InputError, match="without an excluded pixel"):
        check_scene(with_settings(still, stereo={"on": False}))
    with pytest.raises(InputError, match=r"use a smaller focal, or smaller pulsation.amplitude"):
        check_scene(with_settings(small("breathing"), focal=4.0, pulsation={"amplitude": 0.1}))


def test_without_stereo_there_is_no_right_picture(tmp_path):
    settings = with_settings(small("pulling"), stereo={"on": False})
    write_sequence(tmp_path, settings)
    assert not (tmp_path / "images_right").exists()
    np.testing.assert_array_equal(read_sequence(tmp_path, EXACT).masks, simulate(settings).sequence.masks)


def test_depth_beyond_the_largest_level_is_refused(tmp_path):
    deep = with_settings(small("still"), depth_errors={"on": True, "sigma": 1e6})
    with pytest.raises(InputError, match=r"depth/000000.png: the prior depth reaches \d+ mm; use at most 65535"):
        write_sequence(tmp_path, deep, "still")
