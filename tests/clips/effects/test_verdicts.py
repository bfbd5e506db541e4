"""Each effect alone is found, and nothing else; noise is measured; held-out frames are not read."""

from dataclasses import replace

import numpy as np
import pytest
from pages.effects.study import blurred, expectation, settings_of, smoky
from scenes import clip, inspected

from endotsr.clips.effects.frames import reduced_frames
from endotsr.clips.effects.inspect import EFFECTS, inspect_sequence, inspection_record
from endotsr.clips.effects.noise import estimate_noise
from endotsr.clips.effects.plan import make_plan
from endotsr.clips.effects.verdict import EffectVerdict
from endotsr.clips.effects.views import view_verdict
from endotsr.clips.simulator.cameras import make_cameras
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.training.runs.files import finite

pytestmark = pytest.mark.slow

ALONE = ("breathing", "pulsation", "pull", "exposure", "brightening", "highlights", "instrument", "depth_errors")


@pytest.mark.parametrize("effect", ["", *ALONE])
def test_an_effect_alone_is_found_and_no_other(effect):
    names = ("noise", effect) if effect else ("noise",)
    found = inspected(*names)
    for name, expected in expectation(names).items():
        if name != "periodic motion" and expected is not None:
            assert found.verdicts[name].present == expected, (name, found.verdicts[name].reason)


@pytest.mark.parametrize("sigma", [0.005, 0.01, 0.03])
@pytest.mark.parametrize("effects, most", [((), 1.1), (("breathing", "highlights"), 1.5)])
def test_noise_is_measured_and_moving_texture_adds_little_to_it(sigma, effects, most):
    sequence = clip(*effects)
    rng = np.random.default_rng(0)
    noisy = np.clip(sequence.images + rng.normal(0, 255 * sigma, sequence.images.shape), 0, 255)
    changed = replace(sequence, images=np.rint(noisy).astype(np.uint8))
    assert 0.9 * sigma < estimate_noise(changed, reduced_frames(changed)).level < most * sigma


def test_held_out_frames_are_not_read():
    sequence = clip("noise", "exposure")
    images, depth, masks = sequence.images.copy(), sequence.depth.copy(), sequence.masks.copy()
    images[sequence.test_index] = 255 - images[sequence.test_index]
    depth[sequence.test_index] = np.nan
    masks[sequence.test_index] = False
    changed = inspect_sequence(replace(sequence, images=images, depth=depth, masks=masks))
    assert inspection_record(changed) == inspection_record(inspected("noise", "exposure"))


def test_a_beating_clip_has_its_rate_and_harmonics():
    found = inspected("noise", "pulsation", frames=40)
    assert found.verdicts["motion"].kind == "periodic"
    (line,) = found.lines
    assert line.cycles == pytest.approx(5.0, abs=0.15) and line.harmonics == 2
    assert found.per_minute(line.cycles) is None
    assert found._replace(frame_rate=20.0).per_minute(5.0) == pytest.approx(150.0)


def test_a_pull_is_no_rate():
    assert inspected("noise", "pull", frames=40).verdicts["motion"].kind == "irregular"


def test_gain_and_white_balance_are_told_apart_from_local_light():
    assert "gain" in inspected("noise", "exposure").verdicts["photometric"].kind
    assert "white balance" in inspected("noise", "exposure").verdicts["photometric"].kind
    assert "local" not in inspected("noise", "exposure").verdicts["photometric"].kind
    assert "local" in inspected("noise", "brightening").verdicts["photometric"].kind


def test_a_moving_camera_is_no_moving_tissue():
    found = inspected("noise", "camera_motion")
    assert found.verdicts["camera motion"].present and not found.verdicts["motion"].present


@pytest.mark.parametrize("amplitude, degree", [(0.001, 0), (1.0, 0), (9.0, 1), (40.0, 2)])
def test_wider_views_determine_higher_degrees(amplitude, degree):
    """Millimetres of a camera that is 50 mm away."""
    sequence = clip("noise", "camera_motion")
    cameras = make_cameras(settings_of(("noise", "camera_motion"), 0, sequence.count, amplitude), sequence.times)
    moved = replace(sequence, cameras=cameras)
    assert view_verdict(moved, reduced_frames(moved)).details["degree"] == degree


def test_too_little_tissue_leaves_motion_open():
    """Motion is then assumed, so that no component is switched off by mistake."""
    sequence = clip("noise", "camera_motion")
    masks = np.zeros_like(sequence.masks)
    masks[:, 40:70, 40:70] = True
    found = inspect_sequence(replace(sequence, masks=masks))
    verdict, kept = found.verdicts["motion"], dict(make_plan(found, PAPER).kept)
    assert verdict.present and verdict.kind == "unknown"
    assert kept["model.deformation"] == kept["model.spectral_motion"] == verdict.reason


def test_too_little_tissue_leaves_light_open():
    """A change is then assumed, so that neither colour over time nor exposure is switched off by mistake."""
    sequence = clip("noise", "exposure")
    masks = np.zeros_like(sequence.masks)
    masks[:, 48:64, 48:64] = True
    found = inspect_sequence(replace(sequence, masks=masks))
    verdict = found.verdicts["photometric"]
    assert verdict.present and verdict.kind == "unknown" and verdict.confidence == 0.5
    plan = make_plan(found, PAPER)
    assert "model.appearance" in dict(plan.kept)
    assert found.verdicts["motion"].kind == "unknown" and "half waves" not in " ".join(plan.remarks)


def test_a_moving_camera_without_depth_keeps_every_degree_and_gives_numbers():
    sequence = clip("noise", "camera_motion")
    verdict = inspect_sequence(replace(sequence, depth=np.zeros_like(sequence.depth))).verdicts["view change"]
    assert verdict.present and verdict.kind == "unknown" and verdict.details["degree"] == 3
    assert np.isfinite([verdict.statistic, verdict.details["angle_degrees"], *verdict.details["changes"]]).all()


def test_depth_in_steps_is_said():
    sequence = clip("noise")
    steps = inspect_sequence(replace(sequence, depth=np.rint(sequence.depth))).verdicts["depth quality"]
    assert "quantised" in steps.kind and steps.details["step"] == 1.0


def test_blurred_and_smoky_frames_are_found_and_told_apart():
    sequence = clip("noise")
    blur, smoke = inspect_sequence(blurred(sequence, 2.0)), inspect_sequence(smoky(sequence, 0.4))
    assert blur.verdicts["blur"].present and not blur.verdicts["smoke"].present
    assert smoke.verdicts["smoke"].present and not smoke.verdicts["blur"].present
    assert len(blur.verdicts["blur"].details["frames"]) == 3
    assert len(smoke.verdicts["smoke"].details["frames"]) == 6


def test_frames_without_tissue_spoil_no_verdict_on_the_others():
    """A scope that is withdrawn for a third of the clip, at its middle too."""
    sequence = clip("noise")
    masks = sequence.masks.copy()
    masks[[2, 3, 4, 5, 11, 12, 13, 14]] = False
    whole, found = inspect_sequence(sequence), inspect_sequence(replace(sequence, masks=masks))
    for name in ("smoke", "blur", "depth quality", "motion"):
        assert found.verdicts[name].kind == whole.verdicts[name].kind, found.verdicts[name].reason
    assert masks[sequence.train_index[found.clip.reference]].any()


def test_verdicts_have_every_effect_and_a_sentence():
    found = inspected("noise", "instrument")
    assert tuple(found.verdicts) == EFFECTS
    for verdict in found.verdicts.values():
        assert verdict.reason.endswith(".") and (verdict.reason[0].isupper() or verdict.reason[0].isdigit())
        assert 0.5 <= verdict.confidence <= 1.0
    record = inspection_record(found)
    assert record == finite(record)  # JSON holds every number


def test_confidence_is_half_at_the_threshold_and_grows_on_both_sides():
    verdict = EffectVerdict("e", True, "k", 2.0, 2.0, "", "", 0.01, "R.")
    assert verdict.confidence == 0.5
    assert verdict._replace(statistic=4.0).confidence == verdict._replace(statistic=1.0).confidence == 0.875
    assert verdict._replace(statistic=0.0, false_positive_rate=0.0).confidence == 1.0
    assert verdict._replace(statistic=4.0, kind="unknown").confidence == 0.5


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_frame_rate_that_is_none_is_refused(rate):
    with pytest.raises(InputError, match="frame rate"):
        inspect_sequence(clip("noise"), rate)


@pytest.mark.parametrize("width, height, frames", [(16, 16, 3), (48, 32, 4), (33, 17, 9)])
def test_the_smallest_clips_are_inspected(width, height, frames):
    found = inspect_sequence(simulate(SimulatorSettings(width=width, height=height, frames=frames)).sequence)
    assert tuple(found.verdicts) == EFFECTS
