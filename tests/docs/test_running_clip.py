"""Chapter 14 and the page of the presets say what the records of the running clip say; the extract is of such a run."""

import numpy as np
from pages.book import running_clip, running_scene
from pages.store.commands import loaded
from pages.store.program import RESULTS
from running_clip import FOLDER, load

from endotsr.method.splatting.render import render_forward
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.training.fitting.model import raster_settings, scene_at

RECORD = running_clip.PROGRAM.read()


def test_another_record_makes_another_table():
    run = RECORD["runs"][0]
    psnr = run["psnr"] | {"model": [value - 3 for value in run["psnr"]["model"]]}
    other = RECORD | {"runs": [run | {"psnr": psnr}]}
    assert running_clip.table(other) != running_clip.table(RECORD)


def test_three_seeds_are_above_the_blend_and_level_with_flow():
    """So the chapter says, and that flow needs no model."""
    found = running_clip.means(RECORD)
    assert [run["seed"] for run in RECORD["runs"]] == [0, 1, 2]
    assert (found["model"] > found["two_neighbours"] + 2).all()
    assert (abs(found["model"] - found["flow_interpolation"]) < 0.1).all()


def test_larger_rates_put_three_seeds_ahead_of_flow():
    """So chapter 14 says of the rates that `quick` has now."""
    found = running_clip.means(loaded(RESULTS / "quick_simulated.json"))
    assert found["model"].size == 3 and (found["model"] > found["flow_interpolation"] + 0.1).all()


def rendered(clip, scene):
    return render_forward(scene, clip.camera, raster_settings(clip.config), degree=0)[0].colour


def test_the_extract_renders_the_frame_as_the_recorded_run_did():
    """Runs of one seed differ between versions of the package by a few hundredths of a decibel."""
    clip, run = load(), RECORD["runs"][0]
    assert (clip.about["seed"], clip.about["iterations"]) == (run["seed"], run["iterations_done"])
    recorded = {name: values[run["frames"].index(clip.about["frame"])] for name, values in run["psnr"].items()}
    picture = np.clip(rendered(clip, clip.scene), 0, 1)
    assert abs(psnr_tissue(picture, clip.image, clip.mask) - recorded["model"]) < 0.1
    blend = (clip.before + clip.after) / 2
    np.testing.assert_allclose(psnr_tissue(blend, clip.image, clip.mask), recorded["two_neighbours"], atol=1e-5)
    fewer = clip.scene._replace(opacity_logit=np.where(np.arange(len(clip.scene.opacity_logit)) % 20, 0, -9.0)
                                .astype(np.float32))  # fmt: skip
    assert psnr_tissue(np.clip(rendered(clip, fewer), 0, 1), clip.image, clip.mask) < recorded["model"] - 3


def test_the_whole_gaussians_are_those_of_the_scene_at_its_time():
    clip = load()
    found, _ = scene_at(clip.gaussians, clip.spectral, clip.config.model, clip.time)
    places = {tuple(place) for place in clip.scene.position.T.tolist()}
    assert {tuple(place) for place in found.position.T.tolist()} <= places
    later, _ = scene_at(clip.gaussians, clip.spectral, clip.config.model, clip.time + 0.01)
    assert not {tuple(place) for place in later.position.T.tolist()} <= places


def test_the_pixel_is_where_the_model_is_worst():
    clip = load()
    error = np.square(rendered(clip, clip.scene) - clip.image).mean(axis=0, dtype=np.float64)
    assert running_scene.worst_pixel(error, clip.mask) == clip.pixel
    assert clip.mask[clip.pixel[1], clip.pixel[0]]


def test_the_extract_is_a_few_megabytes():
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < 4e6
