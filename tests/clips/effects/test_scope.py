"""The test of a moving camera: poses that differ, equal poses with depth, and pictures alone."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import clip, inspected

from endotsr.clips.effects.frames import reduced_frames
from endotsr.clips.effects.inspect import inspect_sequence
from endotsr.clips.effects.plan import make_plan
from endotsr.clips.effects.scope import camera_verdict
from endotsr.clips.sequences.read import NOT_METRIC
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER, with_settings
from endotsr.results.report.inspection import inspection_html, inspection_text

SWING = 6.0  # mm


def verdict(sequence):
    return camera_verdict(sequence, reduced_frames(sequence))


def without_poses(sequence):
    return replace(sequence, cameras=[sequence.cameras[0]] * sequence.count, static_camera=True)


def without_depth(sequence):
    return replace(sequence, depth=np.zeros_like(sequence.depth))


def hand_held(seed):
    """A hand-held camera with a large path."""
    from pages.effects.study import settings_of

    settings = settings_of(("noise", "camera_motion"), seed, 24, 8.0)
    return simulate(with_settings(settings, camera_motion={"path": "hand"})).sequence


def test_poses_that_differ_are_a_fact():
    found = verdict(clip("noise", "camera_motion", amplitude=SWING))
    assert (found.kind, found.confidence) == ("moving", 1.0) and "moves by up to" in found.reason


def test_a_camera_that_only_turns_is_said_to_turn():
    from scipy.spatial.transform import Rotation

    sequence = clip("noise")
    turned = [Rotation.from_rotvec([0, 0.01 * k, 0]).as_matrix() for k in range(sequence.count)]
    cameras = [camera._replace(rotation=turn) for camera, turn in zip(sequence.cameras, turned)]
    found = verdict(replace(sequence, cameras=cameras, static_camera=False))
    assert "moves by up to 0 mm and turns by up to 13.18 degrees" in found.reason and "rotation" in found.unit


@pytest.mark.parametrize("seed", [21, 22])
def test_without_poses_a_moving_camera_is_seen(seed):
    found = verdict(without_poses(clip("noise", "camera_motion", seed=seed, amplitude=SWING)))
    assert found.present and found.kind == "moving" and 0.5 < found.confidence < 1
    assert "All frames have the same pose" in found.reason and "endotsr poses estimates the poses" in found.reason
    assert found.statistic > found.threshold == pytest.approx(0.83)


@pytest.mark.parametrize("effects", [("noise",), ("noise", "pull"), ("noise", "breathing", "pulsation", "pull")])
def test_a_still_camera_in_front_of_moving_tissue_is_still(effects):
    found = verdict(clip(*effects, seed=21))
    assert not found.present and found.kind == "none" and "the scope is still" in found.reason
    assert found.confidence < 1 or found.details["flow"] < 0.1  # a picture that does not move at all


def test_between_the_thresholds_it_is_open():
    """Breathing alone: the whole tissue moves, and a moving scope would look the same."""
    found = verdict(clip("noise", "breathing", seed=21))
    assert not found.present and found.kind == "unknown" and found.confidence == 0.5 and "unclear" in found.reason


def test_without_depth_it_moves_or_cannot_be_told():
    moves = verdict(without_depth(without_poses(hand_held(21))))
    assert moves.present and "drifts by" in moves.reason and "endotsr depth" in moves.reason
    for sequence in (clip("noise"), clip("noise", "pull"), without_poses(clip("noise", "camera_motion"))):
        found = verdict(without_depth(sequence))
        assert not found.present and found.kind == "unknown" and "cannot be told" in found.reason


def test_assumed_depth_counts_as_none():
    """A plane in place of the depth explains no flow, which would be taken for a still camera."""
    sequence = replace(clip("noise", "pull"), notes=[f"{NOT_METRIC}a plane"])
    assert verdict(sequence).kind == "unknown" and verdict(clip("noise", "pull")).kind == "none"


def test_masked_frames_leave_it_open():
    sequence = clip("noise", "pull")
    found = verdict(replace(sequence, masks=np.zeros_like(sequence.masks)))
    assert found.kind == "unknown" and "cannot be told" in found.reason
    assert verdict(without_depth(replace(sequence, masks=np.zeros_like(sequence.masks)))).kind == "unknown"


def test_the_inspection_says_so_in_text_page_and_plan():
    found = inspect_sequence(without_poses(clip("noise", "camera_motion", amplitude=SWING)))
    plan = make_plan(found, PAPER)
    assert any("The camera moves, but its poses do not" in remark for remark in plan.remarks)
    assert "endotsr poses estimates the poses" in inspection_text(found, plan)
    assert "not known" in inspection_html("a", found, plan)
    known = inspected("noise", "camera_motion", amplitude=SWING)
    assert not any("its poses do not" in remark for remark in make_plan(known, PAPER).remarks)
