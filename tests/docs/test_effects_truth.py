"""Errors against the truth: the measured courses are those of the scene, and the tables hold every variant."""

import numpy as np
import pytest
from pages.effects.truth import SCENES, VARIANTS, depth_error, light_courses, light_scores, table
from pages.store.intervals import interval
from pages.store.marks import read_json
from pages.store.program import RESULTS

from endotsr.api import train
from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects

TINY = {
    "training": {"iterations": 12, "residual_activation": 2, "threads": 1},
    "initialisation": {"first_frame_points": 300, "other_frame_points": 0},
    "density": {"until": 1},
}


@pytest.fixture(scope="module")
def scene():
    """Light alone, without noise."""
    return simulate(with_effects(SimulatorSettings(width=64, height=48, frames=6), "exposure", "brightening"))


@pytest.fixture(scope="module")
def run(scene):
    return train(scene.sequence, on_message=lambda line: None, **TINY)


def test_without_the_prior_or_s_one_number_of_paper_changes_by_more_than_its_interval():
    """As docs/effects.md says: the depth error of the clip with light alone, without S."""
    scenes = read_json(RESULTS / "effects_truth.json", "effects measure truth")["scenes"]
    changed = []
    for scene, rows in scenes.items():
        for variant in ("`paper` without S", "`paper` without the prior"):
            for key in rows["`paper`"][0]:
                less = [a[key] - b[key] for a, b in zip(rows[variant], rows["`paper`"], strict=True)]
                mean, half = interval(less)
                if abs(mean) > half:
                    changed.append((scene, variant, key))
    assert changed == [("light", "`paper` without S", "depth_mm")]


def test_rows_of_equal_settings_are_named_and_others_are_not():
    """A reader of two equal rows learns that the settings are equal; different rows say nothing of it."""
    record = read_json(RESULTS / "effects_truth.json", "effects measure truth")
    assert "the settings of `demo` are those of `sharp` at this length" in table(record)
    other = [row | {"psnr": row["psnr"] + 1} for row in record["scenes"]["light"]["`demo`"]]
    scenes = record["scenes"] | {"light": record["scenes"]["light"] | {"`demo`": other}}
    assert "those of `sharp`" not in table(record | {"scenes": scenes})


def test_true_courses_are_those_of_the_pictures(scene, run):
    """The pixel at a piece of tissue shows its light, but for the place within the pixel and the rounding."""
    true, modelled = light_courses(run, scene)
    assert true.shape == modelled.shape and true.shape[:2] == (6, 3)
    change, x, y = true - true.mean(axis=0), *(((np.arange(n) + 0.5) / n * s) for n, s in ((16, 64), (12, 48)))
    column, row = (a.ravel().astype(int) for a in np.meshgrid(x, y))
    shown = scene.sequence.images[:, :, row, column].astype(float)
    shown -= shown.mean(axis=0)
    assert np.sqrt((change**2).mean()) > 5
    assert np.sqrt(((change - shown) ** 2).mean()) < 0.1 * np.sqrt((change**2).mean())


def test_scores_are_zero_where_nothing_is_explained(scene, run):
    found = light_scores(run, scene)
    assert found["light_grey"] > 5 and 0 < found["colour_grey"] < found["light_grey"]
    plain = train(scene.sequence, on_message=lambda line: None, model={"appearance": False}, **TINY)
    without = light_scores(plain, scene)
    assert without["colour_grey"] == 0.0
    assert without["light_error_grey"] == pytest.approx(without["light_grey"]) == pytest.approx(found["light_grey"])


def test_depth_error_is_in_millimetres(scene, run):
    """The Gaussians start on the true surface and have hardly moved."""
    assert 0.0 < depth_error(run, scene) < 5.0


def test_the_tables_hold_every_variant():
    row = {
        "psnr": 30.0, "depth_mm": 0.5, "scene_units": 0.1, "pixels": 0.3, "motion_scene_units": 0.4,
        "motion_pixels": 1.2, "light_grey": 10.0, "colour_grey": 8.0, "light_error_grey": 5.0,
    }  # fmt: skip
    result = {
        "seeds": 2, "iterations": 10, "frames": 24, "date": "2026-01-01T00:00:00",
        "machine": {"processor": "any", "cores": 1},
        "scenes": {scene: {name: [row, row] for name in VARIANTS} for scene in SCENES},
    }  # fmt: skip
    text = table(result)
    assert all(text.count(f"| {name} |") == 2 for name in VARIANTS)
    assert "| 75 ± 0 % |" in text  # 5 of 10 grey levels are left: three quarters of the variance are explained
    assert "| 75 ± 0 % | 8.00 ± 0.00 |" in text  # 0.1 of 0.4 mm is left
    assert "moves by 0.40 mm (1.20 px)" in text
