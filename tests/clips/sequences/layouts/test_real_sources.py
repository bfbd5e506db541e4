"""The clips of ../shared/data that are no sequence yet: one `prepare` each makes one. Skipped without the data."""

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import SequenceConfig
from endotsr.method.splatting.camera import camera_centre


@pytest.mark.data
def test_one_frame_of_a_phantom_with_true_depth(tmp_path):
    folder = data_folder("c3vd_frame")
    words = ["--camera", "770", "770", "675", "540", "--masks", folder / "valid.png", "--excluded-value", "black"]
    words += ["--depth", folder / "depth_index_u8.png", "--depth-unit", "arbitrary", "--scale", "0.5"]
    said = ["prepare", folder / "color.png", "--out", tmp_path / "clip", *words]
    assert main([str(word) for word in said]) == 0
    clip = describe(tmp_path / "clip")
    assert (clip.count, clip.unit) == (1, "arbitrary") and clip.intrinsics
    assert clip.intrinsics[:6] == (385.0, 385.0, 337.5, 270.0, 675, 540)
    assert clip.depth and clip.masks
    depth, tissue = clip.depth(0), clip.masks(0)
    stored = read_png(folder / "depth_index_u8.png")[::2, ::2]
    assert depth is not None and tissue is not None and 0.3 < tissue.mean() < 1
    inside = tissue & (depth > 0)
    assert 9 <= depth[inside].min() and depth[inside].max() <= 156
    assert np.median(np.abs(depth[inside] - stored[inside])) <= 1


@pytest.mark.data
def test_a_moving_camera_with_poses_of_its_own_files(tmp_path):
    folder = data_folder("sinus_endoscopy")
    said = ["prepare", folder, "--out", tmp_path / "clip", "--frames", "0:6", "--scale", "0.1"]
    assert main([str(word) for word in said]) == 0
    sequence = read_sequence(tmp_path / "clip", SequenceConfig(), 0.2)
    assert sequence.count == 6 and not sequence.static_camera and (sequence.width, sequence.height) == (192, 108)
    with np.load(folder / "cameras_points.npz") as stored:
        poses = stored["w2c"][:6]
    centres = np.array([-pose[:3, :3].T @ pose[:3, 3] for pose in poses])
    found = np.array([camera_centre(camera) for camera in sequence.cameras])
    ways = [np.linalg.norm(np.diff(places, axis=0), axis=1) for places in (centres, found)]
    np.testing.assert_allclose(ways[1] / ways[1].sum(), ways[0] / ways[0].sum(), rtol=1e-6)  # of another scale
    assert 40 < np.median(sequence.depth[sequence.depth > 0]) < 90  # the median of all frames became 60
    assert sequence.masks.any() and not sequence.masks.all()
