"""The viewer page in use, and of unusual scenes: nothing visible, one key time, a lost context, a late picture."""

import json
import re
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from browser import browser, dom, drawn
from remote import Remote

from endotsr.clips.sequences.record import recorded
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.results.report.figures import bytes_image
from endotsr.results.views.cameras import turned
from endotsr.results.views.page import page, write_page
from endotsr.results.views.trajectories import key_times, rotation_levels, trajectories, unit

sys.path.insert(0, str(Path(__file__).parents[2] / "results" / "export"))
from made_up_model import CAMERA, moving_scene

pytestmark = pytest.mark.slow  # a browser
SAID = "document.getElementById('{}').textContent"
SLIDE = """((time) => { const slider = document.getElementById('slider'); slider.value = time;
  slider.dispatchEvent(new Event('input')); })"""


@pytest.fixture(scope="module")
def held_out(tmp_path_factory):
    """A page with three held-out frames, and their names and times."""
    sequence = simulate(SimulatorSettings(width=64, height=48, frames=20)).sequence
    file = tmp_path_factory.mktemp("page") / "page.html"
    write_page(file, moving_scene(frames=20), "made up", 8, sequence)
    return file, [(sequence.names[i], float(sequence.times[i])) for i in sequence.test_index]


def shown(remote: Remote, file: Path) -> Remote:
    """The page, as soon as it shows a picture."""
    remote.open(file, file.parent)
    remote.until(f"{SAID.format('shown')}.includes('view')")
    return remote


def changed(file: Path, script: str) -> Path:
    """The page in a browser that a script has changed."""
    found = file.with_name("changed.html")
    begin = '<script type="application/json"'
    text = file.read_text(encoding="utf-8").replace(begin, f"<script>{script}</script>{begin}", 1)
    found.write_text(text, encoding="utf-8")
    return found


def still_scene(moving_camera: bool):
    """Gaussians that do not move, seen by a camera that does or does not."""
    scene = moving_scene(200)
    still = scene.model.gaussians._replace(fdm_weight=None, appearance_coefficients=None, motion_coefficients=None)
    cameras = [turned(CAMERA, 0.1 * k, 0.0, 10.0) for k in range(4)] if moving_camera else [CAMERA]
    record = msgspec.structs.replace(scene.record, static_camera=not moving_camera, cameras=recorded(cameras))
    return type(scene)(record, scene.model._replace(gaussians=still))


def test_a_scene_without_a_visible_gaussian_is_a_dark_page(tmp_path):
    browser()
    scene = moving_scene()
    scene.model.gaussians.opacity_logit[:] = -20
    write_page(tmp_path / "a.html", scene, "a", 8)
    assert drawn(tmp_path / "a.html", "t=0.5").max() == 0
    assert "0 Gaussians, 5 key times" in dom(tmp_path / "a.html", "t=0")


def test_colours_below_zero_are_not_clamped_before_they_are_summed(tmp_path):
    """The exposure belongs to the sum (B13): with a negative bias, dark Gaussians made the page too bright."""
    browser()
    scene = moving_scene(400, exposure=True)
    scene.model.gaussians.opacity_logit[:] = 3
    scene.model.gaussians.log_scale[:] += 1
    scene.model.frames.exposure_bias[:] = -0.4
    write_page(tmp_path / "a.html", scene, "a", 8)
    out = scene.render(0.0, CAMERA)
    solid = out.opacity > 0.99
    off = (drawn(tmp_path / "a.html", "t=0").astype(float) - bytes_image(out.colour))[solid]
    assert solid.mean() > 0.9 and -10 * np.log10(np.mean(off**2) / 255**2) > 45


def test_a_quaternion_of_zeros_is_no_rotation():
    """As in (B2); in the page, its Gaussian was not drawn."""
    rows = np.array([[0, 0, 0, 0], [1e-30, 0, 0, 1e-30], [0, 1e30, 0, 0]], np.float32).T
    np.testing.assert_allclose(unit(rows).T, [[1, 0, 0, 0], [0.5**0.5, 0, 0, 0.5**0.5], [0, 1, 0, 0]], atol=1e-6)
    scene = still_scene(False)
    scene.model.gaussians.quaternion[:, 5] = 0
    levels = trajectories(scene, np.array([0.0])).bytes[:4, 0]
    assert np.abs(levels.astype(np.int8)).max(axis=0).min() == np.abs(rotation_levels(unit(rows)[:, None])).max() == 127


def test_a_log_scale_beyond_the_limit_takes_no_level_from_the_others():
    scene = still_scene(False)
    scene.model.gaussians.log_scale[0, :2] = -1e6, 1e6
    found = trajectories(scene, np.array([0.0]))
    assert (found.low[3], found.high[3]) == (-40, 40)


@pytest.mark.parametrize("degree", [0, 3])
def test_the_camera_of_a_still_scene_moves_and_its_colours_follow(degree, tmp_path):
    browser()
    scene = still_scene(moving_camera=True)
    model = msgspec.structs.replace(scene.model.config.model, harmonics_degree=degree)
    config = msgspec.structs.replace(scene.model.config, model=model)
    harmonics = scene.model.gaussians.harmonics[: (degree + 1) ** 2]
    gaussians = scene.model.gaussians._replace(harmonics=np.ascontiguousarray(harmonics))
    scene = type(scene)(scene.record, scene.model._replace(config=config, gaussians=gaussians))
    assert len(key_times(scene, 8)) == (1 if degree == 0 else 5)
    write_page(tmp_path / "a.html", scene, "a", 8)
    wanted = bytes_image(scene.render(0.75, scene.cameras[3]).colour).astype(float)
    off = np.mean((drawn(tmp_path / "a.html", "t=0.75") - wanted) ** 2)
    assert -10 * np.log10(off / 255**2) > 45
    assert not re.search(r'id="slider"[^>]*hidden', dom(tmp_path / "a.html", "t=0"))


def test_the_page_of_one_picture_has_no_slider(tmp_path):
    browser()
    write_page(tmp_path / "a.html", still_scene(moving_camera=False), "a", 8)
    content = dom(tmp_path / "a.html", "t=0")
    assert re.search(r'id="slider"[^>]*hidden', content) and ", 1 key time;" in content


def test_the_error_layer_stays_while_time_moves_fast(held_out, remote):
    """The recorded frame of each time is decoded later; time moves on before."""
    file, frames = held_out
    shown(remote, file).value("""(() => { const layer = document.getElementById('layer'); layer.value = 'error';
      layer.dispatchEvent(new Event('change')); })()""")
    remote.until(f"{SAID.format('truth_name')}.includes({json.dumps(frames[0][0])})")
    for time in np.linspace(0.1, frames[-1][1], 12):
        remote.value(f"{SLIDE}({time})")
    remote.value(f"(() => {{ for (const t of [0.1, 0.3, 0.5, 0.6, 0.9]) {SLIDE}(t); }})()")
    remote.until(f"{SAID.format('truth_name')}.includes({json.dumps(frames[-1][0])})")
    assert remote.value("document.getElementById('layer').value") == "error"
    assert not remote.value("document.getElementById('held_out').hidden")


def test_steps_in_the_error_layer_go_to_the_next_held_out_frame(held_out, remote):
    file, frames = held_out
    shown(remote, file).value("""(() => { const layer = document.getElementById('layer'); layer.value = 'error';
      layer.dispatchEvent(new Event('change')); })()""")
    remote.until(f"{SAID.format('truth_name')}.includes({json.dumps(frames[0][0])})")
    for key, place in ((".", 1), (".", 2), (".", 0), (",", 2)):
        remote.key(key)
        remote.until(f"{SAID.format('truth_name')}.includes({json.dumps(frames[place][0])})")
        assert f"t = {frames[place][1]:.3f}" in remote.value(SAID.format("time"))


KEY = """((on, key, repeat) => document.getElementById(on).dispatchEvent(
  new KeyboardEvent('keydown', {key, repeat, bubbles: true, cancelable: true})))"""


def test_keys_work_after_a_button_and_a_key_that_is_held_plays_once(held_out, remote):
    shown(remote, held_out[0])
    remote.value(f"{KEY}('orbit', '.', false)")
    assert "t = 0.050" in remote.value(SAID.format("time"))
    remote.value(f"{KEY}('orbit', ' ', false)")  # presses the button
    assert remote.value(SAID.format("play")) == "Play"
    remote.value(f"[false, true, true, true].forEach((repeat) => {KEY}('scene', ' ', repeat))")
    assert remote.value(SAID.format("play")) == "Stop"
    remote.value(f"[false, true, true, true].forEach((repeat) => {KEY}('scene', 'o', repeat))")
    assert remote.value("document.getElementById('orbit').getAttribute('aria-pressed')") == "true"


def test_a_zoom_while_a_distance_is_measured_is_drawn(held_out, remote):
    shown(remote, held_out[0]).value("document.getElementById('measure').click()")
    before = remote.value("document.getElementById('scene').toDataURL()")
    remote.value("""(() => { const canvas = document.getElementById('scene'), box = canvas.getBoundingClientRect();
      canvas.setPointerCapture = () => 0;
      const finger = (kind, pointerId, x) => canvas.dispatchEvent(new PointerEvent(kind, {
        pointerId, pointerType: 'touch', clientX: box.left + x, clientY: box.top + 50, buttons: 1}));
      finger('pointerdown', 1, 100); finger('pointerdown', 2, 140); finger('pointermove', 2, 300); })()""")
    assert remote.value("document.getElementById('scene').toDataURL()") != before


def windowed(tmp_path: Path) -> Path:
    """A page of two windows with a gap between them."""
    text = page(moving_scene(200), "a", 8)
    about = json.loads(re.search(r'id="about">(.*?)</script>', text, re.S)[1])
    data = re.search(r'id="data">(.*?)</script>', text, re.S)[1]
    keys = ("count", "times", "low", "high", "cameras")
    part = {key: about.pop(key) for key in keys} | {"first": 0, "held_out": []}
    (tmp_path / "0.js").write_text(f"endotsr_window[0]({json.dumps(part)},{json.dumps(data)})")
    spans = [("0", 0, 0.4), ("1", 0.6, 1)]
    about["windows"] = [
        {"name": n, "frames": n, "begin": b, "end": e, "file": f"{n}.js", "count": 200} for n, b, e in spans
    ]
    about |= {"count": 200, "left_out": []}
    whole = f'id="about">{json.dumps(about)}</script>'
    (tmp_path / "a.html").write_text(
        re.sub(r'id="about">.*?</script>', lambda _: whole, text, flags=re.S), encoding="utf-8"
    )
    return tmp_path / "a.html"


def test_no_distance_is_measured_where_no_window_is_shown(tmp_path, remote):
    """The picture that stays in a gap is in colour: its red was taken for a depth."""
    shown(remote, windowed(tmp_path)).value("document.getElementById('measure').click()")
    box = remote.value("(({left, top, width, height}) => [left + width / 2, top + height / 2])"
                       "(document.getElementById('scene').getBoundingClientRect())")  # fmt: skip
    remote.click(*box)
    remote.click(*box)
    assert remote.value(SAID.format("length")).startswith("Distance 0 mm")
    remote.value(f"{SLIDE}(0.5)")
    assert "No window" in remote.value(SAID.format("shown"))
    remote.click(*box)
    assert "No surface there" in remote.value(SAID.format("length"))


def test_a_lost_context_is_said(held_out, remote):
    shown(remote, held_out[0]).key(" ")
    remote.value(
        "document.getElementById('scene').getContext('webgl2').getExtension('WEBGL_lose_context').loseContext()"
    )
    remote.until("!document.getElementById('failure').hidden")
    assert "reload it" in remote.value(SAID.format("failure")) and remote.value(SAID.format("play")) == "Play"


@pytest.mark.parametrize(
    ("script", "element", "said"),
    [
        ("WebGL2RenderingContext.prototype.getError = () => 1285", "failure", "memory cannot hold the Gaussians"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "failure", "requires WebGL 2"),
        ("delete window.DecompressionStream", "failure", "cannot show the scene"),
        ("Object.defineProperty(Document.prototype, 'fullscreenEnabled', {value: false})", "full", ""),
        ("const has = WebGL2RenderingContext.prototype.getExtension; WebGL2RenderingContext.prototype.getExtension ="
         " function (name) { return name === 'EXT_color_buffer_float' ? null : has.call(this, name); }", "measure", ""),
    ],
)  # fmt: skip
def test_what_a_browser_lacks_is_said_or_not_offered(script, element, said, held_out):
    browser()
    content = dom(changed(held_out[0], script), "t=0")
    tag, found = re.search(rf'<\w+ ([^>]*id="{element}"[^>]*)>([^<]*)', content).groups()
    assert said in found and ("hidden" in tag) is (said == "")
