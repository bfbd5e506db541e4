"""Depth with a scale of its own in each frame is named; tissue and scopes that move are not."""

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from scipy.ndimage import zoom

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.depth_steps import DepthStep, DepthSteps, loaded_steps, scale_finding
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import with_settings

SIZE = {"width": 160, "height": 128, "frames": 16}


def scaled(sequence, spread: float, seed: int = 0):
    """The sequence with the depth of every frame times a factor of its own."""
    factors = np.exp(np.random.default_rng(seed).normal(0, spread, sequence.count)).astype(np.float32)
    return replace(sequence, depth=sequence.depth * factors[:, None, None])


@cache
def scene(name):
    return simulate(msgspec.structs.replace(named_scene(name), **SIZE)).sequence


@cache
def coming_near():
    settings = with_effects(SimulatorSettings(**{**SIZE, "frames": 48}), "camera_motion", "noise")
    path = {"path": "hand", "amplitude": 25.0, "cycles": 4.0}
    return simulate(with_settings(settings, camera_motion=path)).sequence


def codes(sequence) -> list[str]:
    return [found.code for found in loaded_steps(sequence).findings("depth")]


@pytest.mark.parametrize("name", ["breathing", "pulling", "cutting", "moving-camera", "everything"])
def test_a_scene_that_moves_has_one_scale(name):
    assert codes(scene(name)) == []
    assert codes(scaled(scene(name), 0.1)) == ["depth-own-scale"]


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_a_scope_that_comes_much_nearer_between_two_pictures_has_one_scale(stride):
    """Its flow is wrong at this size: a single step is unexplained by more than the limit."""
    sequence, steps = coming_near(), DepthSteps(48 // stride)
    for k, i in enumerate(range(0, 48, stride)):
        steps.add(k, sequence.picture(i), sequence.depth[i], sequence.masks[i])
    assert steps.findings("depth") == [] and (stride < 4 or steps.jumps)


def test_one_frame_of_another_scale_is_no_scale_of_every_frame():
    sequence = simulate(SimulatorSettings(**SIZE)).sequence
    depth = sequence.depth.copy()
    depth[7] *= 1.3
    there, back = loaded_steps(replace(sequence, depth=depth)).findings("depth")
    assert there.code == back.code == "depth-scale-jump" and (there.frame, back.frame) == (7, 8)
    assert "from frame 6 to 7 the depth becomes 1.30 times as large" in there.what and "0.78 times" in back.what


@pytest.mark.parametrize("name", ["breathing", "pulling", "moving-camera"])
@pytest.mark.parametrize("factor, found", [(1.2, ["depth-scale-jump"]), (0.8, ["depth-scale-jump"]), (1.08, [])])
def test_depth_in_parts_is_named_at_their_border(name, factor, found):
    """As of a network that computes the depth of a clip in parts."""
    depth = scene(name).depth.copy()
    depth[9:] *= factor
    assert codes(replace(scene(name), depth=depth)) == found


def test_a_jump_between_the_sampled_steps_is_found():
    """Of 300 steps 48 are sampled; the depth of every one is compared."""
    picture, depth = np.zeros((16, 16, 3), np.uint8), np.full((16, 16), 50.0, np.float32)
    for border in (100, 101, 102):
        steps = DepthSteps(300)
        for i in range(300):
            steps.add(i, picture, depth * (1.25 if i >= border else 1.0), None)
        assert [found.frame for found in steps.findings("depth")] == [border]


def test_the_picture_has_to_grow_as_the_depth_falls():
    """A plane that comes nearer by 5 % a frame: named if its picture does not grow."""
    rough = np.random.default_rng(2).integers(0, 255, (16, 20, 3)).astype(np.uint8)
    texture = zoom(rough, (12, 12, 1), order=1)
    growing, resting = DepthSteps(10), DepthSteps(10)
    for i in range(10):
        near = 1.05 ** (i - 9)
        height, width = (round(side * near) for side in (128, 160))
        crop = np.s_[96 - height // 2 : 96 - height // 2 + height, 120 - width // 2 : 120 - width // 2 + width]
        shown = zoom(texture[crop], (128 / height, 160 / width, 1), order=1)[:128, :160]
        depth = np.full((128, 160), 60 * near, np.float32)
        growing.add(i, shown, depth, None)
        resting.add(i, texture[:128, :160], depth, None)
    assert scale_finding(growing.found, "depth") == []
    (found,) = scale_finding(resting.found, "depth")
    assert "the depth changes by 4.9%" in found.what and "(medians over 9 steps)" in found.what


def test_what_a_motion_allows():
    assert DepthStep(-0.1, 0.0).unexplained == pytest.approx(0.1)
    assert DepthStep(0.1, 0.02).unexplained == pytest.approx(0.02) and DepthStep(0.1, 0.5).unexplained == 0.0
    few = [DepthStep(0.2, 0.0)] * 5
    assert scale_finding(few, "depth") == [] and len(scale_finding([*few, few[0]], "depth")) == 1


def test_steps_are_between_neighbours_and_at_most_48():
    picture, depth = np.zeros((16, 16, 3), np.uint8), np.full((16, 16), 50.0, np.float32)
    steps = DepthSteps(300)
    for i in range(300):
        steps.add(i, picture, depth, None)
    assert len(steps.found) == 48
    gap = DepthSteps(6)
    for i in (0, 1, 3, 4):
        gap.add(i, picture, depth if i != 1 else None, None)
    assert len(gap.found) == 1  # from 3 to 4


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting"])
def test_recorded_depth_has_one_scale(name):
    pictures, masks, depth = (
        [read_png(file)[::2, ::2] for file in sorted((data_folder(name) / part).iterdir())[:32]]
        for part in ("images", "masks", "depth")
    )

    def said(factors):
        steps = DepthSteps(32)
        for i, factor in enumerate(factors):
            steps.add(i, pictures[i], (factor * depth[i]).astype(np.float32), masks[i] < 128)
        return [found.code for found in steps.findings("depth")]

    assert said(np.ones(32)) == []
    assert said(np.exp(np.random.default_rng(0).normal(0, 0.05, 32))) == ["depth-own-scale"]
    assert said(np.where(np.arange(32) < 17, 1, 1.2)) == ["depth-scale-jump"]
