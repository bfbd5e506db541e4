"""The evaluation dictionary: right frames, right means, valid JSON whatever happens."""

import dataclasses
import json

import numba
import numpy as np
import pytest
from made_up_sequence import made_up

from data_folder import data_folder
from endotsr.results.evaluation import evaluate
from endotsr.results.evaluation.baselines import two_neighbours, unit_image
from endotsr.results.evaluation.lpips import LpipsWeights
from endotsr.results.evaluation.metrics import image_metrics


@pytest.fixture
def sequence():
    rng = np.random.default_rng(5)
    still = rng.integers(60, 180, (3, 24, 32))
    images = np.stack([np.clip(still + 4 * i + rng.integers(-3, 4, still.shape), 0, 255) for i in range(12)])
    masks = np.ones((12, 24, 32), bool)
    masks[:, :, :5] = False
    return made_up(images.astype(np.uint8), [1, 9], masks)


def strict(data):
    """Through JSON, where NaN and Infinity are errors."""
    return json.loads(json.dumps(data, allow_nan=False))


def test_constant_error_gives_the_known_decibels(sequence):
    result = evaluate.evaluate_frames(sequence, [1, 9], lambda i: unit_image(sequence, i) + np.float32(0.1))
    share = sequence.masks[1].mean()
    assert result["mean"]["psnr_tissue"] == pytest.approx(20.0, abs=1e-4)
    assert result["mean"]["psnr_full"] == pytest.approx(20.0 - 10 * np.log10(share), abs=1e-4)
    assert [row["frame"] for row in result["per_frame"]] == [1, 9]
    assert result["per_frame"][1]["name"] == "frame-000009.png"
    assert result["per_frame"][1]["time"] == pytest.approx(9 / 12)


def test_mean_is_the_mean_of_the_frames(sequence):
    noise = {1: 0.01, 9: 0.05}
    result = evaluate.evaluate_frames(sequence, [1, 9], lambda i: unit_image(sequence, i) + np.float32(noise[i]))
    first, second = (row["psnr_tissue"] for row in result["per_frame"])
    assert first == pytest.approx(40, abs=0.01)
    assert result["mean"]["psnr_tissue"] == pytest.approx((first + second) / 2)


def test_without_weights_lpips_is_null_with_a_reason(sequence):
    result = strict(evaluate.evaluate_model(sequence, lambda i: two_neighbours(sequence, i)))
    assert result["lpips_reason"].startswith("no LPIPS weights")
    for row in (result["held_out"], result["training"], *result["baselines"].values()):
        assert row["mean"]["lpips"] is None and row["mean"]["lpips_symmetric"] is None


def test_perfect_render_is_null_and_counted(sequence):
    result = evaluate.evaluate_frames(sequence, [1, 9], lambda i: unit_image(sequence, i))
    assert result["mean"]["psnr_full"] is None and result["mean"]["psnr_tissue"] is None
    assert result["not_finite"] == 8 and result["excluded"]["psnr_full"] == result["excluded"]["psnr_tissue_8bit"] == 2
    assert result["mean"]["ssim_full"] == pytest.approx(1.0)
    strict(result)


@pytest.mark.parametrize("odd", ["a render that is not finite", "an empty mask"])
def test_a_frame_without_a_value_is_null_and_left_out_of_the_mean(odd, sequence):
    renders = {i: unit_image(sequence, i) + np.float32(0.1) for i in (1, 9)}
    if odd == "an empty mask":
        sequence.masks[9] = False
    else:
        renders[9][1, 4, 8] = np.nan
    result = strict(evaluate.evaluate_frames(sequence, [1, 9], renders.__getitem__))
    assert result["per_frame"][1]["psnr_tissue"] is None and result["excluded"]["psnr_tissue"] == 1
    assert (result["not_finite"] > 0) == (odd == "a render that is not finite")
    assert result["mean"]["psnr_tissue"] == pytest.approx(20.0, abs=1e-4)


def test_a_frame_without_tissue_has_no_lpips(sequence, monkeypatch):
    """Two black pictures have the distance 0."""
    monkeypatch.setattr(evaluate, "lpips_obstacle", lambda *of: None)
    monkeypatch.setattr(evaluate, "feature_maps", lambda image, *of: [image])
    monkeypatch.setattr(evaluate, "map_distances", lambda a, b, weights: [np.abs(a[0] - b[0]).mean()])
    sequence.masks[9] = False
    found = evaluate.evaluate_frames(sequence, [1, 9], lambda i: unit_image(sequence, i) + np.float32(0.1), object())
    first, second = (row["lpips"] for row in found["per_frame"])
    assert second is None and found["mean"]["lpips"] == first > 0


def test_render_of_a_wrong_size_is_refused(sequence):
    with pytest.raises(ValueError, match=r"frame 1: the render is \(3, 5, 5\)"):
        evaluate.evaluate_frames(sequence, [1], lambda i: np.zeros((3, 5, 5)))


def test_no_frames_have_no_mean(sequence):
    result = evaluate.evaluate_frames(sequence, [], lambda i: unit_image(sequence, i))
    assert result["per_frame"] == [] and result["mean"] == {}


def test_training_frames_stand_beside_the_held_out_ones(sequence):
    asked = []

    def render(index):
        asked.append(index)
        return unit_image(sequence, index) + np.float32(0.1 if index in (1, 9) else 0.01)

    result = strict(evaluate.evaluate_model(sequence, render, training=[0, 4]))
    assert asked == [1, 9, 0, 4]
    assert result["temporal_gap"]["psnr_tissue"] == pytest.approx(20.0, abs=0.01)
    assert result["frames"] == {
        "total": 12,
        "training": 10,
        "held_out": [1, 9],
        "training_sample": [0, 4],
        "tissue_fraction": pytest.approx(27 / 32),
        "extrapolated": [],
        "coverage": [{"frame": i, "tissue": 24 * 27, "never_seen": 0, "seen_once": 0} for i in (1, 9)],
    }


def test_training_sample_takes_training_frames_only(sequence):
    assert evaluate.training_sample(sequence) == [0, 7]


def test_baseline_rows_rank_as_the_data_says(sequence):
    """Brightness rises linearly: the two-neighbour blend beats the copy, the copy beats the mean over time."""
    table = evaluate.evaluate_model(sequence, lambda i: unit_image(sequence, i))["baselines"]
    assert list(table) == list(evaluate.EVERY_BASELINE)
    values = [table[k]["mean"]["psnr_tissue"] for k in ("temporal_mean", "nearest_frame", "two_neighbours")]
    assert values == sorted(values) and values[2] > values[1] + 1
    assert all(len(row["per_frame"]) == 2 and row["label"] for row in table.values())
    strict(table)


def test_renders_with_equal_tissue_are_measured_once(sequence, monkeypatch):
    """Of three, two differ in excluded pixels alone; the third has equal values in another precision."""
    frames = [int(i) for i in sequence.test_index[:2]]
    masks = sequence.masks.copy()
    masks[:, :4, :4] = False
    sequence = dataclasses.replace(sequence, masks=masks)
    seen, real = [], evaluate.image_metrics
    monkeypatch.setattr(evaluate, "image_metrics", lambda render, *rest: seen.append(render) or real(render, *rest))

    def other(index):
        return np.where(sequence.masks[index], half(index), np.float32(np.nan))

    def half(index):
        return np.float32(0.5) * unit_image(sequence, index)

    methods = {"half": half, "other": other, "wide": lambda index: half(index).astype(np.float64)}
    found = evaluate.evaluate_methods(sequence, frames, methods)
    assert len(seen) == 2 * len(frames)
    assert found["half"] == found["other"] == evaluate.evaluate_frames(sequence, frames, other)


def test_methods_share_the_maps_of_a_frame_and_not_their_rows(monkeypatch):
    """Three methods on two frames: a map for each frame and range, and for each of the six renders and range."""
    rng, asked = np.random.default_rng(3), []
    sequence = made_up(rng.integers(0, 255, (3, 3, 40, 40)).astype(np.uint8), [0, 1], np.ones((3, 40, 40), bool))
    weights = LpipsWeights((), (), (np.ones(3, np.float32),), np.zeros(3), np.ones(3))
    monkeypatch.setattr(evaluate, "feature_maps", lambda image, *_: asked.append(0) or [image])
    methods = {f"+ {c}": lambda i, c=c: np.minimum(unit_image(sequence, i) + np.float32(c), 1) for c in (0.0, 0.1, 0.2)}
    found = evaluate.evaluate_methods(sequence, [0, 1], methods, weights)
    assert len(asked) == 2 * 2 + 2 * 6
    alone = {name: evaluate.evaluate_frames(sequence, [0, 1], render, weights) for name, render in methods.items()}
    assert found == alone and found["+ 0.0"]["mean"]["lpips"] == 0 < found["+ 0.1"]["mean"]["lpips"]


def test_model_baselines_and_cross_fade_share_the_maps_of_a_frame(monkeypatch):
    """One map of the frame and one of each different render for each range; the cross-fade is its own blend."""
    rng, asked = np.random.default_rng(3), []
    sequence = made_up(rng.integers(0, 255, (3, 3, 40, 40)).astype(np.uint8), [1], np.ones((3, 40, 40), bool))
    weights = LpipsWeights((), (), (np.ones(3, np.float32),), np.zeros(3), np.ones(3))
    monkeypatch.setattr(evaluate, "feature_maps", lambda image, *_: asked.append(0) or [image])
    found = evaluate.evaluate_model(
        sequence, lambda i: unit_image(sequence, i), weights, own={"cross_fade": lambda i: two_neighbours(sequence, i)}
    )
    different = {unit_image(sequence, 1).tobytes()}
    different |= {np.asarray(make(sequence)(1)).tobytes() for _, make in evaluate.EVERY_BASELINE.values()}
    assert len(asked) == 2 * (1 + len(different)) and len(different) < len(evaluate.EVERY_BASELINE)
    assert found["cross_fade"]["mean"] == found["baselines"]["two_neighbours"]["mean"]
    assert found["held_out"]["mean"]["lpips"] == 0 < found["cross_fade"]["mean"]["lpips"]


@pytest.mark.parametrize(
    ("threads", "pixels", "count"), [(1, 640 * 512, 2), (4, 640 * 512, 4), (16, 640 * 512, 6), (16, 1920 * 1080, 2)]
)
def test_renders_measured_at_once_are_bounded_by_threads_and_memory(threads, pixels, count, monkeypatch):
    monkeypatch.setattr(numba, "get_num_threads", lambda: threads)
    assert evaluate.renders_at_a_time(pixels) == count


@pytest.mark.parametrize("threads", [1, 2])
def test_metrics_are_bitwise_equal_for_every_number_of_threads(threads):
    """Renders measured two at a time give what `image_metrics` gives for each alone."""
    rng = np.random.default_rng(4)
    sequence = made_up(rng.integers(0, 255, (2, 3, 20, 24)).astype(np.uint8), [0], rng.random((2, 20, 24)) < 0.8)
    renders = {str(k): rng.random((3, 20, 24)).astype(np.float32) for k in range(3)}
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        found = evaluate.evaluate_methods(sequence, [1], {k: lambda i, k=k: renders[k] for k in renders})
    finally:
        numba.set_num_threads(before)
    for name, render in renders.items():
        alone = image_metrics(render, unit_image(sequence, 1), sequence.masks[1])
        row = found[name]["per_frame"][0]
        assert {key: row[key] for key in alone} == alone


@pytest.mark.slow
@pytest.mark.data
def test_known_row_on_pulling_with_lpips():
    from endotsr.clips.sequences.read import read_sequence
    from endotsr.config import SequenceConfig
    from endotsr.results.evaluation.lpips import load_lpips_weights

    sequence = read_sequence(data_folder("endonerf_pulling"), SequenceConfig())
    weights = load_lpips_weights(data_folder("lpips_alex") / "lpips_alex_v0_1.npz")
    result = evaluate.evaluate_frames(sequence, sequence.test_index, lambda i: two_neighbours(sequence, i), weights)
    assert result["mean"]["psnr_full"] == pytest.approx(40.51, abs=0.01)
    assert result["mean"]["psnr_tissue"] == pytest.approx(38.73, abs=0.01)
    assert result["mean"]["lpips"] == pytest.approx(0.0177, abs=2e-4)
    assert result["mean"]["lpips_symmetric"] == pytest.approx(0.0248, abs=2e-4)
