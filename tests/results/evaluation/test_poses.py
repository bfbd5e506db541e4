"""The change of the cameras: known turns and shifts, and none where nothing was corrected."""

from dataclasses import replace

import numpy as np
import pytest

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.method.equations.pose import pose_forward
from endotsr.results.evaluation.run import pose_change
from endotsr.results.report.run_text import pose_sentence


@pytest.fixture(scope="module")
def clip():
    return simulate(SimulatorSettings(width=64, height=48, frames=9)).sequence


def moved(clip, vector, offset):
    cameras = []
    for camera in clip.cameras:
        rotation, translation, _ = pose_forward(camera.rotation, camera.translation, np.array(vector), np.array(offset))
        cameras.append(camera._replace(rotation=rotation, translation=translation))
    return replace(clip, cameras=cameras)


def test_a_shift_sideways_moves_points_by_focal_length_over_depth(clip):
    found = pose_change(clip, moved(clip, [0.0, 0, 0], [0.5, 0, 0]))
    depth = np.mean([np.median(clip.depth[i][clip.masks[i]]) for i in clip.train_index])
    assert found["degrees"] == pytest.approx(0, abs=1e-5) and found["scene_units"] == pytest.approx(0.5)
    assert found["pixels"] == pytest.approx(clip.cameras[0].fx * 0.5 / depth, rel=0.02)


def test_a_turn_about_the_optical_axis_is_its_angle(clip):
    found = pose_change(clip, moved(clip, [0.0, 0, 0.02], [0.0, 0, 0]))
    assert found["degrees"] == pytest.approx(np.degrees(0.02), rel=1e-6)
    assert found["scene_units"] == pytest.approx(0, abs=1e-9) and 0.2 < found["pixels"] < 0.9
    assert pose_sentence(found).startswith("Mean pose correction 1.15 degrees and 0.00 mm; it moves")


def test_nothing_corrected_is_none(clip):
    assert pose_change(clip, clip) is None
