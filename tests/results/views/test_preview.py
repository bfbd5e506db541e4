"""The moving preview of a report: the scene over time, within its size limit."""

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from endotsr.results.report.figures import bytes_image
from endotsr.results.views import preview
from endotsr.results.views.cameras import fitted

sys.path.insert(0, str(Path(__file__).parents[2] / "results" / "export"))
from made_up_model import CAMERA, moving_scene


@pytest.fixture(scope="module")
def scene():
    return moving_scene(frames=4)


def test_the_preview_moves_and_keeps_its_limit(scene):
    found = preview.preview(scene)
    moving, still = (Image.open(io.BytesIO(content)) for content in (found.moving, found.still))
    assert (moving.n_frames, still.n_frames) == (4, 1) and moving.info["loop"] == 0
    assert len(found.moving) <= preview.PREVIEW_BYTES
    assert (found.width, found.height) == moving.size == (2 * preview.PREVIEW_WIDTH + preview.GAP, 180)


def test_the_left_half_is_the_observed_camera(scene):
    pictures = preview.preview_pictures(scene)
    camera = fitted(CAMERA, preview.PREVIEW_WIDTH, 180)
    for k, time in ((0, 0.0), (3, 0.75)):
        assert np.array_equal(pictures[k][:, : preview.PREVIEW_WIDTH], bytes_image(scene.render(time, camera).colour))
    halves = pictures[1][:, : preview.PREVIEW_WIDTH], pictures[1][:, -preview.PREVIEW_WIDTH :]
    assert np.abs(halves[0].astype(int) - halves[1]).max() > 10, "the other camera has moved"


def test_a_lower_quality_keeps_the_limit_or_there_is_no_preview(scene, monkeypatch):
    pictures = preview.preview_pictures(scene)
    full = len(preview.encoded(pictures, "").moving)
    monkeypatch.setattr(preview, "PREVIEW_BYTES", full - 1)
    assert len(preview.encoded(pictures, "").moving) < full
    monkeypatch.setattr(preview, "PREVIEW_BYTES", 100)
    assert preview.encoded(pictures, "") is None
