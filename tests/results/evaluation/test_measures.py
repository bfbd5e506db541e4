"""Depth, flicker and the right view: made-up renders with known errors."""

import tracemalloc

import msgspec
import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation import measures
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.depth import held_out_depth
from endotsr.results.evaluation.measures import MEASURES, flicker, measure_lines, measured
from endotsr.results.evaluation.right_view import FLOW, moved_flow, moved_left, right_view, stereo_baseline
from endotsr.untrusted.names import choice

LEVEL = np.float32(1 / 255)


def sequence_of(images: np.ndarray, depth: float = 50.0, static: bool = True) -> Sequence:
    """Frames (n, 3, H, W) uint8 of resting tissue at one depth; frames 1 and 5 are held out."""
    n, _, height, width = images.shape
    camera = Camera(np.eye(3), np.zeros(3), 60.0, 60.0, width / 2, height / 2, width, height)
    test = np.array([1, 5])
    return Sequence(
        images, np.ones((n, height, width), bool), np.full((n, height, width), depth, np.float32), np.arange(n) / n,
        [camera] * n, [f"f{i}" for i in range(n)], "mm", static, np.setdiff1d(np.arange(n), test), test,
    )  # fmt: skip


def textured(noise: float, n: int = 9, size: int = 64) -> np.ndarray:
    """Smooth strong texture that rests, with camera noise of a standard deviation in grey levels."""
    rng = np.random.default_rng(2)
    y, x = np.indices((size, size)) / size
    still = 128 + 50 * np.sin(19 * x + 3 * y) * np.cos(23 * y)
    frames = still + noise * rng.standard_normal((n, 3, size, size))
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


def render_of(colour: np.ndarray, depth: float = 50.0, opacity: float = 1.0) -> RenderOut:
    shape = colour.shape[1:]
    flat = lambda value: np.full(shape, value, np.float32)
    return RenderOut(colour.astype(np.float32), flat(depth * opacity), flat(opacity))


def rows_of(found: dict) -> dict[str, dict]:
    return {row["label"]: row for row in found["rows"]}


def test_depth_is_divided_by_opacity_and_compared_with_the_prior():
    sequence = sequence_of(textured(0.0))
    sequence.depth[5] = 60.0  # held out: its neighbours have 50
    sequence.depth[1, :8] = 0.0  # no prior
    sequence.masks[1, :, :8] = False
    found = rows_of(held_out_depth(sequence, lambda i, camera: render_of(np.zeros((3, 64, 64)), 52.0, 0.8)))
    counted = np.array([56 * 56, 64 * 64])
    model, blend = found["this model"], found["blend of the neighbouring priors"]
    assert model["mean_absolute"] == pytest.approx(np.average([2.0, 8.0], weights=counted), rel=1e-6)
    assert model["root_mean_square"] == pytest.approx(np.sqrt(np.average([4.0, 64.0], weights=counted)), rel=1e-6)
    assert model["relative"] == pytest.approx(np.average([2 / 50, 8 / 60], weights=counted), rel=1e-6)
    assert blend["mean_absolute"] == pytest.approx(np.average([0.0, 10.0], weights=counted))
    assert model["covered"] == 1.0


def test_errors_of_depth_are_those_of_pixels_that_every_row_covers():
    sequence = sequence_of(textured(0.0))
    sequence.depth[[0, 2], :32] = 0.0  # no neighbouring prior in half of frame 1
    found = rows_of(held_out_depth(sequence, lambda i, camera: render_of(np.zeros((3, 64, 64)), 53.0)))
    assert found["this model"]["mean_absolute"] == pytest.approx(3.0)
    assert found["this model"]["covered"] == 1.0
    assert found["blend of the neighbouring priors"]["covered"] == pytest.approx(0.75)


def test_a_render_of_background_has_no_depth():
    sequence = sequence_of(textured(0.0))
    found = held_out_depth(sequence, lambda i, camera: render_of(np.zeros((3, 64, 64)), 50.0, 0.3))
    assert found["reason"].startswith("no pixel of the held-out priors has a depth in the model and in the training")
    sequence.depth[[1, 5]] = 0.0
    found = held_out_depth(sequence, lambda i, camera: render_of(np.zeros((3, 64, 64)), 50.0))
    assert found == {"reason": "no held-out frame has a prior depth on tissue"}


def test_flicker_of_noise_is_its_standard_deviation_and_that_of_a_still_render_is_zero():
    sequence = sequence_of(textured(3.0))
    still = textured(0.0)[0] * LEVEL
    found = rows_of(flicker(sequence, lambda i, camera: render_of(still)))
    assert found["the recorded frames"]["all_frames"] == pytest.approx(3.0, rel=0.05)
    assert found["this model"] == {"label": "this model", "all_frames": 0.0, "held_out": 0.0}


def test_a_model_that_jumps_at_held_out_times_is_seen_there():
    sequence = sequence_of(textured(0.0))
    still = textured(0.0)[0] * LEVEL
    found = rows_of(flicker(sequence, lambda i, camera: render_of(still + 6 * LEVEL * (i in (1, 5)))))
    assert found["this model"]["held_out"] == pytest.approx(2 * 6 / np.sqrt(6), rel=1e-4)
    assert 0 < found["this model"]["all_frames"] < found["this model"]["held_out"]


def test_a_steady_change_of_light_is_no_flicker():
    sequence = sequence_of(textured(0.0))
    still = textured(0.0)[0] * LEVEL * np.float32(0.5)
    found = rows_of(flicker(sequence, lambda i, camera: render_of(still + i * LEVEL)))
    assert found["this model"]["all_frames"] < 1e-4


def test_frames_without_tissue_are_left_out_of_the_flicker():
    """The scope leaves the body in frame 4: neither its picture nor its mask counts."""
    sequence = sequence_of(textured(3.0))
    sequence.images[4], sequence.masks[4] = 0, False
    asked, still = [], textured(0.0)[0] * LEVEL
    render = lambda i, camera: asked.append(i) or render_of(still + LEVEL * (i == 1))
    found = flicker(sequence, render)
    rows = rows_of(found)
    assert found["left_out"] == ["f4"] and asked == [0, 1, 2, 3, 5, 6, 7, 8] and found["pixels"] > 4000
    assert rows["the recorded frames"]["all_frames"] == pytest.approx(3.0, rel=0.05)
    assert rows["this model"]["all_frames"] == pytest.approx(np.sqrt((4 + 1) / 6 / 4), rel=1e-4)  # at 1, 2, 6 and 7
    assert rows["this model"]["held_out"] == pytest.approx(np.sqrt(4 / 6), rel=1e-4)  # frame 5 follows frame 4
    assert measure_lines({"flicker": found})[-1] == "flicker: without tissue and left out: f4"


def test_without_three_successive_frames_of_tissue_flicker_has_a_reason():
    sequence = sequence_of(textured(3.0))
    sequence.masks[2::3] = False
    found = flicker(sequence, lambda i, camera: pytest.fail("rendered"))
    assert found == {"reason": "no three successive frames show tissue"}


def test_flicker_of_a_long_clip_holds_few_frames_at_a_time(monkeypatch):
    """All static pixels of all frames at once were 4 GB for 156 frames of 640x512."""
    sequence, static = sequence_of(textured(3.0, n=200)), np.ones((64, 64), bool)
    monkeypatch.setattr(measures, "static_pixels", lambda sequence: static)
    render = lambda i, camera: render_of(sequence.images[i] * LEVEL)
    tracemalloc.start()
    found = rows_of(flicker(sequence, render))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    values = sequence.images[:, :, static].astype(np.float64)
    second = (values[:-2] - 2 * values[1:-1] + values[2:]) / np.sqrt(6)
    expected = np.sqrt(np.square(second).mean(axis=(1, 2)))
    for row in found.values():
        assert row["all_frames"] == pytest.approx(np.sqrt(np.square(expected).mean()), rel=1e-5)
        assert row["held_out"] == pytest.approx(np.sqrt(np.square(expected[[0, 4]]).mean()), rel=1e-5)
    assert peak < 10 * values[0].nbytes


def test_flicker_needs_a_resting_camera_and_resting_tissue():
    render = lambda i, camera: render_of(np.zeros((3, 64, 64)))
    assert "camera moves" in flicker(sequence_of(textured(0.0), static=False), render)["reason"]
    moving = np.stack([np.roll(textured(0.0)[0], 4 * i, axis=2) for i in range(9)])
    assert "static pixels" in flicker(sequence_of(moving), render)["reason"]


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A simulated stereo sequence in a folder, and its settings."""
    folder = tmp_path_factory.mktemp("pair")
    size = SimulatorSettings(width=128, height=96, frames=9)
    settings = with_effects(size, "stereo", "depth_rounding", "instrument")
    write_sequence(folder, settings)
    return folder, read_sequence(folder, SequenceConfig()), settings


def right_pictures(folder):
    files = sorted((folder / "images_right").iterdir())
    return lambda i: read_png(files[i]).transpose(2, 0, 1)


def test_the_baseline_of_a_pair_follows_from_disparity_and_depth(pair):
    folder, sequence, settings = pair
    found = stereo_baseline(sequence, right_pictures(folder))
    assert found is not None
    assert found[0] == pytest.approx(settings.stereo.baseline, rel=0.05) and found[1] < 0.15


def test_the_true_right_view_is_better_than_the_moved_left_picture_and_that_than_the_unmoved(pair):
    folder, sequence, settings = pair
    right, asked = right_pictures(folder), []

    def render(index, camera):
        asked.append(camera)
        return render_of(right(index) * LEVEL + np.float32(0.01))

    found = right_view(sequence, str(folder), SequenceConfig(), render)
    rows = rows_of(found)
    assert rows["this model"]["held_out_psnr"] == pytest.approx(40.0, abs=0.5)  # a constant error of 0.01
    order = [rows[label]["held_out_psnr"] for label in rows]
    assert list(rows) == ["this model", "left picture moved by the prior depth", FLOW, "left picture as it is"]
    assert order == sorted(order, reverse=True) and order[2] > order[3] + 1
    assert asked[0].translation[0] == pytest.approx(-settings.stereo.baseline, rel=0.05)
    assert rows["this model"]["training_psnr"] == pytest.approx(40.0, abs=0.5)


def test_the_moved_flow_is_a_prediction_for_held_out_frames_and_reads_none_of_them(pair):
    folder, sequence, settings = pair
    found = rows_of(
        right_view(sequence, str(folder), SequenceConfig(), lambda i, camera: render_of(unit_image(sequence, i)))
    )
    assert "training_psnr" not in found[FLOW] and found[FLOW]["held_out_psnr"] > 20
    held_out = int(sequence.test_index[0])
    before = moved_flow(sequence, held_out, settings.stereo.baseline)
    sequence.images[held_out], sequence.depth[held_out] = 0, 0
    np.testing.assert_array_equal(moved_flow(sequence, held_out, settings.stereo.baseline), before)


def test_flow_at_rest_moves_by_the_disparity_and_its_hole_repeats_the_nearest_column():
    sequence = sequence_of(textured(0.0))
    moved = moved_flow(sequence, 1, 5.0)  # f B / z = 6 px
    np.testing.assert_allclose(moved[:, :, :58], unit_image(sequence, 1)[:, :, 6:], atol=2e-3)
    np.testing.assert_array_equal(moved[:, :, 58:], np.repeat(moved[:, :, 57:58], 6, axis=2))
    sequence.depth[:] = 0
    np.testing.assert_allclose(moved_flow(sequence, 1, 5.0), unit_image(sequence, 1), atol=2e-3)


def test_the_instrument_does_not_count_in_the_right_view(pair):
    _, sequence, settings = pair
    moved = moved_left(sequence, 4, settings.stereo.baseline)
    assert 0.2 < moved.counted.mean() < sequence.masks[4].mean()
    none = moved_left(sequence_of(textured(0.0), depth=0.0), 0, 4.0)
    assert not none.counted.any()


def test_excluded_pixels_are_moved_with_the_tissue():
    sequence = sequence_of(textured(0.0))
    sequence.masks[0, 20:40, 30:50] = False
    counted = moved_left(sequence, 0, 5.0).counted  # f B / z = 6 px
    assert not counted[20:40, 24:44].any()
    assert counted[5:15, 5:50].all() and counted[25:35, 5:20].all()


def test_without_a_right_picture_there_is_a_reason(tmp_path):
    sequence = sequence_of(textured(0.0))
    found = right_view(sequence, str(tmp_path), SequenceConfig(), lambda i, camera: pytest.fail("rendered"))
    assert "no images_right/" in found["reason"]


def test_a_folder_of_the_name_of_the_simulated_sequence_is_not_its_source(tmp_path, monkeypatch):
    (tmp_path / "simulated" / "images_right").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    sequence, render = sequence_of(textured(0.0)), lambda i, camera: pytest.fail("rendered")
    found = right_view(sequence, "simulated", SequenceConfig(), render)
    assert "no images_right/" in found["reason"]


def test_a_pair_without_one_baseline_is_not_measured(pair):
    folder, sequence, _ = pair
    wrong = msgspec.structs.replace(SequenceConfig(), scale=1.0)
    rng = np.random.default_rng(1)
    sequence = read_sequence(folder, wrong)
    sequence.depth[:] = np.where(sequence.depth > 0, rng.uniform(20, 200, sequence.depth.shape), 0)
    found = right_view(sequence, str(folder), wrong, lambda i, camera: pytest.fail("rendered"))
    assert "give no consistent baseline" in found["reason"]


def test_unknown_measures_are_refused_and_lines_are_plain():
    with pytest.raises(InputError, match=f"use {choice(MEASURES)}"):
        measured(["beauty"], None, None, "")  # pyright: ignore[reportArgumentType]
    lines = measure_lines(
        {
            "depth": {"unit": "mm", "rows": [{"label": "this model", "mean_absolute": 1.25, "covered": 0.5}]},
            "flicker": {"reason": "no"},
        }
    )
    assert lines == ["depth: this model: mean error 1.25 mm, covered 50 %", "flicker: not measured: no"]
    rows = [
        {"label": "a", "all_frames": 0.5, "held_out": None},
        {"label": "b", "held_out_psnr": 30.0, "held_out_ssim": 0.9},
    ]
    assert measure_lines({"x": {"rows": rows}}) == [
        "x: a: all frames 0.5 grey levels", "x: b: held-out PSNR 30 dB, held-out SSIM 0.9",
    ]  # fmt: skip


@pytest.mark.data
def test_the_pair_of_endonerf_is_calibrated():
    folder = data_folder("endonerf_pulling")
    sequence = read_sequence(folder, SequenceConfig(frames="0:9"))
    found = stereo_baseline(sequence, right_pictures(folder))
    assert found is not None and found[0] > 0 and found[1] < 0.15
