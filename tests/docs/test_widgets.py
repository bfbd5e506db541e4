"""The figures that respond to the reader: a drag changes them, their numbers are those of the definition, they fit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from page_visits import found_browser, visits

from endotsr.definition.dictionary import dictionary_forward
from endotsr.definition.laplacian import support_masks
from endotsr.definition.matern import matern_penalty_reverse, matern_weights
from endotsr.method.splatting.render import RenderOut
from endotsr.studies.windows.scene import blended

pytestmark = pytest.mark.slow  # a browser
ROOT = Path(__file__).parents[2]
STATIC = ROOT / "docs" / "_static"
CHAPTERS = {"compositing": "compositing", "matern": "motion_and_prior", "masks": "laplacian_pyramid",
            "cutoff": "tradeoff", "seam": "one_seam"}  # fmt: skip
WIDTHS = (390, 1000, 1400)
SCRIPT = """
const say = (page, key) => {
  const root = frame.contentDocument.documentElement;
  const states = {};
  for (const box of frame.contentDocument.querySelectorAll("div.widget")) states[box.dataset.widget] = box.state;
  found.push({page, key, over: root.scrollWidth - root.clientWidth, states: JSON.parse(JSON.stringify(states))});
};
const drag = (name, from, to) => {
  const element = frame.contentDocument.querySelector(`[data-widget=${name}] canvas`);
  const box = element.getBoundingClientRect(), Event = frame.contentWindow.PointerEvent;
  const at = ([x, y]) => ({bubbles: true, clientX: box.left + x * box.width, clientY: box.top + y * box.height});
  element.dispatchEvent(new Event("pointerdown", at(from)));
  for (let k = 1; k <= 20; k++)
    element.dispatchEvent(new Event("pointermove", at(from.map((v, i) => v + ((to[i] - v) * k) / 20))));
  element.dispatchEvent(new Event("pointerup", at(to)));
};
const slide = (name, value) => {
  const input = frame.contentDocument.querySelector(`[data-name="${name}"]`);
  const from = Number(input.value);
  for (let k = 1; k <= 10; k++) {  // a drag of the handle passes the values on its way
    input.value = k < 10 ? from + ((value - from) * k) / 10 : value;
    input.dispatchEvent(new frame.contentWindow.Event("input"));
  }
};
async function visit(page) {
  for (const width of WIDTHS) {
    frame.style.width = width + "px";
    await open(page);
    await pause(100);
    say(page, "start " + width);
  }
  drag("compositing", [0.4, 0.4], [0.4, 0.0]);
  drag("masks", [0.1, 0.1], [0.4, 0.3]);
  slide("correlation length", 0.05);
  slide("log10 of its weight λ_msp", -4);
  slide("log10 of the cutoff", -1);
  slide("log10 of the stop", -1);
  slide("overlap, frames", 20);
  slide("correlation of the errors", 0.5);
  say(page, "moved");
  slide("opacity 2", 0.25);
  const field = frame.contentDocument.querySelector("[data-widget=masks] canvas");
  frame.contentWindow.focus();
  field.focus();
  for (const key of ["ArrowLeft", " ", "ArrowUp", " ", "ArrowUp", " ", " "])
    field.dispatchEvent(new frame.contentWindow.KeyboardEvent("keydown", {key, cancelable: true}));
  say(page, "keys");
}
"""


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    """What the figures show, by key: at the start at each width, and after drags."""
    if found_browser() is None:
        pytest.skip("no browser found")
    folder = tmp_path_factory.mktemp("widgets")
    boxes = "".join(f'<div class="widget" data-widget="{name}"></div>' for name in CHAPTERS)
    for name in ("widgets.js", "endotsr.css"):
        (folder / name).write_text((STATIC / name).read_text("utf-8"), encoding="utf-8")
    head = '<meta charset="utf-8"><link rel="stylesheet" href="endotsr.css"><script src="widgets.js"></script>'
    page = f'<!doctype html><meta name="viewport" content="width=device-width">{head}<body>{boxes}'
    (folder / "play.html").write_text(page, encoding="utf-8")
    seen = visits(folder, ["play.html"], SCRIPT.replace("WIDTHS", json.dumps(WIDTHS)))
    assert not [name for name in seen.missing if "favicon" not in name]
    assert not [entry for entry in seen.found if entry.get("kind") == "error"], seen.found
    return {entry["key"]: entry for entry in seen.found}


def test_no_figure_is_wider_than_the_page(states):
    assert [states[f"start {width}"]["over"] for width in WIDTHS] == [0, 0, 0]


def test_a_drag_of_an_opacity_changes_light_and_gradients(states):
    before, after = (states[key]["states"]["compositing"] for key in ("start 1400", "moved"))
    assert before["alpha"] == [0.3, 0.6, 0.5] and after["alpha"] == [0.3, 1.0, 0.5]
    assert after["T"][2:] == [0.0, 0.0] and after["g"][2] == 0.0 and after["g"][1] != 0.0
    colours, target = np.array([[0.85, 0.3, 0.25], [0.3, 0.65, 0.3], [0.25, 0.4, 0.85]]), np.full(3, 0.5)

    def loss(alpha):
        transmittance = np.cumprod(np.concatenate([[1.0], 1 - alpha]))
        pixel = (alpha * transmittance[:3]) @ colours + transmittance[3] * np.full(3, 0.1)
        return ((pixel - target) ** 2).sum() / 2

    for state in (before, after):
        alpha, step = np.array(state["alpha"]), 1e-6
        np.testing.assert_allclose(state["loss"], loss(alpha), rtol=1e-12)
        differences = [(loss(alpha + step * e) - loss(alpha - step * e)) / (2 * step) for e in np.eye(3)]
        np.testing.assert_allclose(state["g"], differences, atol=1e-9)


def test_keys_do_what_a_drag_does(states):
    """The sliders set the opacities; in the mask, arrow keys move a cursor and space changes a pixel."""
    before, after = (states[key]["states"] for key in ("moved", "keys"))
    np.testing.assert_allclose(after["compositing"]["alpha"], [0.3, 0.25, 0.5])
    changed = np.argwhere(np.array(before["masks"]["mask"]) != np.array(after["masks"]["mask"]))
    assert changed.tolist() == [[15, 19], [16, 19]], "a pixel that was changed twice is as it was"


def test_correlation_length_and_penalty_change_the_trajectory(states):
    before, after = (states[key]["states"]["matern"] for key in ("start 1400", "moved"))
    assert (after["length"], round(after["lambda"], 9)) == (0.05, 1e-4)
    assert after["rms"] > 1.5 * before["rms"], "hardly any penalty: the noise is fitted"
    for state in (before, after):
        np.testing.assert_allclose(state["rho"], matern_weights(np.geomspace(1, 16, 8), state["length"]), rtol=1e-12)
        seen, times = np.array(state["seen"]), np.array(state["times"])
        atoms = np.array([dictionary_forward(t, np.geomspace(1, 16, 8))[0] for t in times])
        # The fit minimises mean((atoms C - seen)^2) / 2 + lambda L_msp / 2: its gradient with respect to C is 0.
        C = np.zeros((3, 16, 1))
        C[0, :, 0] = state["C"]
        of_prior = matern_penalty_reverse(state["lambda"] / 2, (C, np.array(state["rho"])))[0, :, 0]
        gradient = atoms.T @ (atoms @ C[0, :, 0] - seen) / len(times) + of_prior
        np.testing.assert_allclose(gradient, 0, atol=1e-7)


def test_a_painted_instrument_removes_the_values_that_the_definition_removes(states):
    before, after = (states[key]["states"]["masks"] for key in ("start 1400", "moved"))
    assert np.sum(before["mask"]) - np.sum(after["mask"]) > 10, "a drag paints a line, a press one pixel"
    for state in (before, after):
        bands = support_masks(np.array(state["mask"], bool)).bands
        assert state["bands"] == [int(band.sum()) for band in bands]


def test_cutoff_and_stop_change_error_and_visits(states):
    before, after = (states[key]["states"]["cutoff"] for key in ("start 1400", "moved"))
    assert 0 < before["largest"] < 5 / 255 < after["largest"] and after["visits"] < before["visits"] < 1


def test_a_longer_overlap_makes_a_smaller_step_and_more_windows(states):
    """Against two pictures 6 levels apart blended by the package, and against the spread of drawn errors."""
    before, after = (states[key]["states"]["seam"] for key in ("start 1400", "moved"))
    assert (before["overlap"], after["overlap"], after["correlation"]) == (8, 20, 0.5)
    for state in (before, after):
        begin, frames = 40 - state["overlap"] // 2, np.arange(81)
        weight = np.clip((frames - begin) / state["overlap"], 0, 1)
        pictures = [RenderOut(np.full((3, 1, 1), v), np.zeros((1, 1)), np.zeros((1, 1))) for v in (0.0, 6.0)]
        shown = np.array([blended(pictures, [1 - w, w]).colour[0, 0, 0] for w in weight])
        np.testing.assert_allclose([state["step"], *state["weight"]], [np.diff(shown).max(), *weight], atol=1e-12)
        drawn = np.random.default_rng(21).normal(size=(2, 100_000))
        other = state["correlation"] * drawn[0] + np.sqrt(1 - state["correlation"] ** 2) * drawn[1]
        spread = [np.std((1 - w) * drawn[0] + w * other) for w in weight]
        np.testing.assert_allclose(state["error"], spread, rtol=0.01)
        covered = state["windows"] * (60 - state["overlap"]) + state["overlap"]
        assert 2000 <= covered < 2000 + 60 - state["overlap"]
    assert after["step"] < before["step"] and after["windows"] > before["windows"]


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_holds_its_figure(name):
    (file,) = (ROOT / "notebooks").glob(f"*_{CHAPTERS[name]}.py")
    assert f'data-widget="{name}"' in file.read_text("utf-8")
    source = (STATIC / "widgets.js").read_text("utf-8")
    assert not re.search(r"https?://|import |fetch\(", source), "nothing is loaded"
