"""The viewer page: numbers that unpack to the scene, one file without a network, and the picture of the browser."""

import base64
import html
import json
import re
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from browser import browser, dom, drawn
from frame_rate import milliseconds_a_picture

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.errors import InputError
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.results.evaluation.depth import normalised_depth
from endotsr.results.export.scene import open_scene
from endotsr.results.report.figures import bytes_image, depth_picture
from endotsr.results.views.page import check_page, page, write_page
from endotsr.results.views.trajectories import key_times, packed, rotation_levels, trajectories

sys.path.insert(0, str(Path(__file__).parents[2] / "results" / "export"))
from made_up_model import CAMERA, moving_scene

pytestmark = pytest.mark.slow

AT_A_KEY, BETWEEN_KEYS = 45.0, 35.0  # dB of the page against the reference renderer, least


def unpacked(content, count, keys):
    """Rows (K, N) of 6 words and 8 bytes, as the page adds them up."""
    planes = np.frombuffer(zlib.decompress(content), np.uint8).reshape(20, keys, count)
    words = planes[0:12:2].astype(np.uint16) | planes[1:12:2].astype(np.uint16) << 8
    return np.cumsum(words, axis=1, dtype=np.uint16), np.cumsum(planes[12:], axis=1, dtype=np.uint8)


def test_the_numbers_of_the_page_are_those_of_the_scene():
    scene = moving_scene()
    found = trajectories(scene, np.array([0.0, 0.3, 1.0]))
    words, small = unpacked(packed(found), 80, 3)
    assert np.array_equal(words, found.words) and np.array_equal(small, found.bytes)
    for k, time in enumerate(found.times):
        moment = scene.at(float(time))
        wanted = np.concatenate([moment.position, moment.log_scale])
        step = (found.high - found.low)[:6, None] / 65535
        assert (np.abs(found.low[:6, None] + words[:, k] * step - wanted) <= 0.51 * step + 1e-6).all()
        turned = small[:4, k].astype(np.int8).astype(np.float32)
        a, b = (covariance_forward(q, moment.log_scale)[0].rotation for q in (turned, moment.quaternion))
        assert np.abs(a - b).max() < 0.03


def test_no_sign_of_a_quaternion_jumps_between_keys():
    scene = moving_scene()
    steady = trajectories(scene, np.array([0.0, 0.01, 0.02]))
    signed = steady.bytes[:4].astype(np.int8).astype(int)
    assert ((signed[:, 1:] * signed[:, :-1]).sum(axis=0) >= 0).all()
    rows = np.random.default_rng(0).normal(size=(4, 1, 9)).repeat(3, axis=1)
    levels = rotation_levels(rows * np.array([1, -1, 1])[:, None])
    assert np.array_equal(levels[:, 1], levels[:, 0]) and np.array_equal(levels[:, 2], levels[:, 0])


def test_gaussians_that_are_never_drawn_are_left_out():
    scene = moving_scene()
    scene.model.gaussians.opacity_logit[:30] = -20
    assert trajectories(scene, np.array([0.0, 1.0])).words.shape == (6, 2, 50)


def test_key_times_are_those_of_the_frames_or_fewer():
    scene = moving_scene()
    assert list(key_times(scene, 32)) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert list(key_times(scene, 3)) == [0.0, 0.5, 1.0]
    still = scene.model.gaussians._replace(fdm_weight=None, appearance_coefficients=None, motion_coefficients=None)
    still = type(scene)(scene.record, scene.model._replace(gaussians=still))
    assert list(key_times(still, 32)) == [0.0]


def test_a_still_scene_whose_exposure_changes_has_the_times_of_the_frames():
    """The colours of the page have the exposure: with one key time, those of the first frame stayed."""
    scene = moving_scene(exposure=True)
    still = scene.model.gaussians._replace(fdm_weight=None, appearance_coefficients=None, motion_coefficients=None)
    still = type(scene)(scene.record, scene.model._replace(gaussians=still))
    times = key_times(still, 32)
    assert list(times) == [0.0, 0.25, 0.5, 0.75, 1.0]
    colours = trajectories(still, times).bytes[4:7]
    assert (colours[:, 0] != colours[:, 2]).any()


def test_of_moving_gaussians_without_deformation_the_key_times_are_even():
    scene = moving_scene()
    only = scene.model.gaussians._replace(fdm_weight=None, appearance_coefficients=None)
    assert list(key_times(type(scene)(scene.record, scene.model._replace(gaussians=only)), 3)) == [0.0, 0.5, 1.0]
    assert key_times(type(scene)(scene.record, scene.model._replace(gaussians=only)), 32).size == 32


def test_the_page_is_one_file_without_a_network(tmp_path):
    text = page(moving_scene(), 'a "<b>@SCRIPT@', 8)
    about = json.loads(re.search(r'id="about">(.*?)</script>', text, re.S)[1])
    assert (about["count"], len(about["times"]), about["unit"]) == (80, 5, "mm")
    data = re.search(r'id="data">(.*?)</script>', text, re.S)[1]
    assert len(zlib.decompress(base64.b64decode(data))) == 20 * 5 * 80
    assert "<b>" not in text and text.count("a &quot;&lt;b&gt;@SCRIPT@") == 2
    assert not re.search(r'(src|href)\s*=\s*"(?!data:)|https?://|import\s*\(|@import', text)
    assert write_page(tmp_path / "a.html", moving_scene(), "a", 8) == (tmp_path / "a.html").stat().st_size


@pytest.mark.parametrize(
    ("name", "keys", "said"),
    [("a.mp4", 8, "use a name that ends in .html"), ("a", 8, "not a page"), ("a.html", 1, "--keys 1"),
     ("a.html", 129, "an integer from 2 to 128")],
)  # fmt: skip
def test_names_that_are_no_page_are_refused(name, keys, said, tmp_path):
    with pytest.raises(InputError) as refused:
        check_page(tmp_path / name, keys)
    assert said in str(refused.value)


def psnr(a, b):
    return -10 * np.log10(np.mean((a.astype(float) - b) ** 2) / 255**2)


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A scene and its page."""
    browser()
    scene, file = moving_scene(200, frames=64), tmp_path_factory.mktemp("page") / "page.html"
    write_page(file, scene, "made up", 128)
    return scene, file


@pytest.mark.parametrize(("time", "least"), [(0.0, AT_A_KEY), (0.5, AT_A_KEY), (63 / 128, BETWEEN_KEYS)])
def test_the_browser_draws_what_the_reference_renders(time, least, opened):
    scene, file = opened
    wanted = bytes_image(scene.render(time, CAMERA).colour)
    shown = drawn(file, f"t={time}")
    assert shown.shape == wanted.shape and psnr(shown, wanted) > least
    assert psnr(shown, bytes_image(scene.render((time + 0.1) % 1, CAMERA).colour)) < BETWEEN_KEYS


def test_the_browser_draws_depth_in_the_colours_of_the_report(opened):
    scene, file = opened
    out = scene.render(0.0, CAMERA)
    about = json.loads(re.search(r'id="about">(.*?)</script>', file.read_text(), re.S)[1])
    wanted = depth_picture(normalised_depth(out), *about["depth_range"])
    opaque = out.opacity > 0.5
    assert psnr(drawn(file, "t=0&layer=depth")[opaque], wanted[opaque]) > 35


def test_a_still_scene_is_drawn_too(tmp_path):
    from endotsr.results.export.files import export

    browser()
    scene = moving_scene()
    export(scene, tmp_path / "a.ply")
    still = open_scene(tmp_path / "a.ply")
    write_page(tmp_path / "a.html", still, "still", 8)
    (camera,) = still.record.frame_cameras
    assert psnr(drawn(tmp_path / "a.html", "t=0"), bytes_image(still.render(0.0, camera).colour)) > AT_A_KEY


def test_a_held_out_frame_stands_beside_the_scene_with_its_error(tmp_path):
    browser()
    sequence = simulate(SimulatorSettings(width=64, height=48, frames=4)).sequence
    scene = moving_scene()
    write_page(tmp_path / "a.html", scene, "made up", 8, sequence)
    shown = drawn(tmp_path / "a.html", "held_out=0&layer=error")
    out, i = scene.render(0.25, CAMERA), int(sequence.test_index[0])
    error = np.abs(np.clip(out.colour, 0, 1) - sequence.frame(i).image).mean(axis=0)
    grey = (np.abs(shown.astype(int) - 96).max(axis=2) <= 7) & ~sequence.masks[i]
    assert grey.sum() == (~sequence.masks[i]).sum() > 0, "excluded pixels are grey"
    bright = shown.astype(float).sum(axis=2)[sequence.masks[i]]
    assert np.corrcoef(np.minimum(error[sequence.masks[i]], 0.1), bright)[0, 1] > 0.9
    assert f"Held-out frame {sequence.names[i]}" in dom(tmp_path / "a.html", "held_out=0")


def test_the_frame_rate_is_measured_in_the_browser(opened):
    assert 0 < milliseconds_a_picture(opened[1]) < 60000


PRESSED = """<script>const watch = setInterval(() => {
  if (!document.getElementById("probe")) return;
  clearInterval(watch);
  const said = (id) => document.getElementById(id).textContent;
  const answers = KEYS.map((key) => {
    document.body.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true}));
    return [said("time"), said("shown"), said("play")];
  });
  document.body.dataset.answers = JSON.stringify(answers);
}, 50);</script></body>"""


def keys_pressed(file, *keys):
    """Time, description and label of the play button after each key."""
    pressed = file.parent / "pressed.html"
    script = PRESSED.replace("KEYS", json.dumps(keys))
    pressed.write_text(file.read_text(encoding="utf-8").replace("</body>", script), encoding="utf-8")
    return json.loads(html.unescape(re.search('data-answers="([^"]*)"', dom(pressed, "t=0&probe"))[1]))


def test_keys_play_turn_and_change_the_frame(opened):
    times = opened[0].record.times
    said = keys_pressed(opened[1], ".", ",", ",", "ArrowLeft", "0", "+", "x", " ", " ")
    assert [time for time, _, _ in said[:3]] == [f"frame {i} (0 to 63), t = {times[i]:.3f}" for i in (1, 0, 63)]
    assert [view.split(",")[0] for _, view, _ in said[2:7]] == [
        "Camera view", "Free view", "Camera view", "Free view", "Free view"
    ]  # fmt: skip
    assert [label for _, _, label in said[6:]] == ["Play", "Stop", "Play"]


def test_the_view_that_is_asked_for_is_drawn_and_a_distance_is_that_of_the_rendered_surface(opened):
    """The page is opened at a shifted view; two pixels give the distance of the points that the reference renders."""
    scene, file = opened
    still, shifted = drawn(file, "t=0.5"), drawn(file, "t=0.5&right=6&down=-3")
    assert psnr(still[8:-8, 8:-16], shifted[5:-11, 14:-10]) > psnr(still[8:-8, 8:-16], shifted[8:-8, 8:-16])
    out = scene.render(0.5, CAMERA)
    depth = normalised_depth(out)
    solid = np.argwhere(out.opacity > 0.9)
    (row, column), (other, across) = solid[len(solid) // 4], solid[3 * len(solid) // 4]
    points = [
        np.array([(u + 0.5 - CAMERA.cx) / CAMERA.fx, (v + 0.5 - CAMERA.cy) / CAMERA.fy, 1.0]) * depth[v, u]
        for v, u in ((row, column), (other, across))
    ]
    content = dom(file, f"t=0.5&measure={column},{row},{across},{other}")
    said = re.search(r'id="length"[^>]*>Distance ([\d.]+) mm on the rendered surface', content)
    assert said, re.search(r'id="length"[^>]*>[^<]*', content)
    assert float(said[1]) == pytest.approx(np.linalg.norm(points[0] - points[1]), rel=0.02)
    assert "An estimate" in content


def test_the_page_names_the_second_of_a_recording_whose_rate_is_known(tmp_path):
    scene = moving_scene()
    timed = replace(scene, record=msgspec.structs.replace(scene.record, duration=2.5))
    write_page(tmp_path / "a.html", timed, "a", 8)
    assert "t = 0.500, 1.25 s<" in dom(tmp_path / "a.html", "t=0.5")


def test_the_error_layer_stays_when_time_moves(tmp_path):
    sequence = simulate(SimulatorSettings(width=64, height=48, frames=20)).sequence
    write_page(tmp_path / "a.html", moving_scene(), "a", 8, sequence)
    held = sequence.times[sequence.test_index]
    content = dom(tmp_path / "a.html", f"layer=error&t={held[1] + 0.01}")
    assert f"Held-out frame {sequence.names[sequence.test_index[1]]}" in content
