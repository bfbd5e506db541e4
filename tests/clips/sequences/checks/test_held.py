"""Masks that are held for several frames are named; masks of each frame, and those that never change, are not."""

import dataclasses

import msgspec
import numpy as np
import pytest

from data_folder import recorded_masks
from endonerf_writer import write_endonerf
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.held import FEWEST, HeldMasks
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER


def moving(count):
    masks = np.ones((count, 24, 40), bool)
    for i in range(count):
        masks[i, 8:16, i % 30 : i % 30 + 10] = False
    return masks


def found(masks):
    held = HeldMasks()
    for mask in masks:
        held.add(mask)
    return held.findings("masks")


@pytest.mark.parametrize("each", [2, 5, 10])
def test_held_masks_are_named_with_their_number_of_frames(each):
    masks = moving(FEWEST * each + each)
    (warning,) = found(masks[np.arange(len(masks)) // each * each])
    assert (warning.code, warning.level) == ("held-masks", "warning")
    assert f"once every {each} frames" in warning.what and f"are {each} frames" in warning.what
    assert not found(masks[: FEWEST * each][np.arange(FEWEST * each) // each * each]), "one change fewer"


def test_masks_of_each_frame_and_of_none_are_not_named():
    assert not found(moving(40))
    assert not found([np.ones((4, 4), bool)] * 40) and not found([None] * 40)
    slow = moving(40)[np.cumsum(np.random.default_rng(0).random(40) < 0.4)]
    assert not found(slow), "an instrument that moves now and then"


def test_a_frame_without_a_mask_does_not_end_the_run():
    masks = list(moving(40)[np.arange(40) // 5 * 5])
    masks[7] = None
    assert found(masks)


@pytest.mark.parametrize("scene", ["cutting", "everything"])
def test_simulated_masks_are_those_of_each_frame(scene):
    settings = msgspec.structs.replace(named_scene(scene), frames=16, width=160, height=128)
    assert not found(frame.tissue for frame in simulated_frames(make_scene(settings)))


@pytest.mark.data
@pytest.mark.parametrize("clip", ["endonerf_pulling", "endonerf_cutting"])
@pytest.mark.parametrize("folder", ["masks", "gt_masks"])
def test_recorded_masks_are_those_of_each_frame(clip, folder):
    masks = recorded_masks(clip, folder)
    for every in (1, 2, 3):
        assert not found(masks[::every])
    assert "once every 5 frames" in found(masks[i // 5 * 5] for i in range(len(masks)))[0].what


def test_check_and_train_name_them(tmp_path):
    sequence = simulate(SimulatorSettings(width=64, height=48, frames=13)).sequence
    masks = np.ones_like(sequence.masks)
    for i in range(13):
        masks[i, 30:40, 10 + i // 2 * 3 : 30 + i // 2 * 3] = False
    write_endonerf(dataclasses.replace(sequence, masks=masks), tmp_path / "clip")
    assert "held-masks" in [found.code for found in check_sequence(tmp_path / "clip", PAPER).findings]
    notes = read_sequence(tmp_path / "clip", PAPER.sequence, PAPER.raster.near).notes
    assert any(note.startswith("warning: held-masks: the mask changes once every 2 frames") for note in notes)
