"""A slit is found where it is, other changes are none, and doubt is said; spoiled frames mislead no other test."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from pages.effects.study import blurred, smoky
from scenes import clip, inspected

from endotsr.clips.effects.frames import reduced_frames, with_clear_reference
from endotsr.clips.effects.inspect import inspect_sequence
from endotsr.clips.effects.noise import estimate_noise
from endotsr.clips.effects.topology import local_correlation, topology_verdict
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("opening", [1.0, 4.0])
def test_a_slit_is_found_where_the_wound_is(opening):
    made = simulate(_cut(opening))
    found = inspect_sequence(made.sequence).verdicts["topology change"]
    assert found.present and found.kind == "suspected" and found.map is not None
    lost = found.map.values == 1
    rows, columns = np.nonzero(lost)
    # the middle of the slit, in pixels of this camera
    focal, distance = 0.89 * 160, 50.0
    assert abs(columns.mean() - (80 - 0.08 * distance * focal / distance)) < 12
    assert abs(rows.mean() - (64 - 0.05 * distance * focal / distance)) < 12
    assert found.details["pixels"] >= 0.6 * lost.sum()


def _cut(opening):
    settings = with_effects(SimulatorSettings(frames=24), "noise", "cutting")
    cutting = msgspec.structs.replace(settings.cutting, opening=opening)
    return msgspec.structs.replace(settings, cutting=cutting)


@pytest.mark.parametrize("names", [["pull"], ["instrument", "breathing"], ["brightening", "highlights"]])
def test_motion_light_and_instruments_change_no_topology(names):
    found = inspected("noise", *names).verdicts["topology change"]
    assert found.kind == "none" and found.statistic < 0.5, found.reason


def test_a_cut_at_the_very_end_is_found_and_one_in_the_middle_that_heals_is_not():
    sequence, cut = clip("noise"), simulate(_cut(4.0)).sequence
    late, healed = sequence.images.copy(), sequence.images.copy()
    late[-4:] = cut.images[-4:]
    healed[10:14] = cut.images[-4:]
    assert inspect_sequence(replace(sequence, images=late)).verdicts["topology change"].present
    assert not inspect_sequence(replace(sequence, images=healed)).verdicts["topology change"].present


def test_ends_that_show_different_places_leave_it_open():
    sequence, other = clip("noise"), clip("noise", seed=1)
    images = np.concatenate([sequence.images[:12], other.images[12:]])
    found = inspect_sequence(replace(sequence, images=images)).verdicts["topology change"]
    assert found.kind == "unknown" and not found.present and "in common" in found.reason


def test_a_moving_camera_leaves_a_new_region_open():
    cut = simulate(_cut(4.0)).sequence
    cameras = clip("noise", "camera_motion", amplitude=1.0).cameras
    found = inspect_sequence(replace(cut, cameras=cameras, static_camera=False)).verdicts["topology change"]
    assert found.kind == "unknown" and found.statistic >= 1.0 and "camera" in found.reason


def test_too_few_clear_frames_leave_it_open():
    sequence = clip("noise")
    found = reduced_frames(sequence)
    noise = estimate_noise(sequence, found)
    clear = np.zeros(found.count, bool)
    clear[:5] = True
    assert topology_verdict(found, clear, noise).kind == "unknown"
    clear[:6] = True
    assert topology_verdict(found, clear, noise).kind == "none"


def test_correlation_is_one_with_the_frame_itself_and_nan_off_tissue():
    sequence = clip("noise", "instrument")
    found = reduced_frames(sequence)
    sigma = float(estimate_noise(sequence, found).working.mean())
    score = local_correlation(found, found.luminance, 3, 3, sigma)
    assert (np.isnan(score) == ~found.masks[3]).all()
    assert np.nanmin(score) > 1 - 1e-5 and np.nanmax(score) <= 1 + 1e-5


@pytest.mark.parametrize("spoil, strength", [(blurred, 0.5), (blurred, 2.0), (smoky, 0.4)])
def test_spoiled_frames_in_the_middle_are_no_motion(spoil, strength):
    """The middle frame is the usual reference; compared with a blurred one, every other frame seems to move."""
    found = inspect_sequence(spoil(clip("noise", frames=40), strength))
    verdict = found.verdicts["blur" if spoil is blurred else "smoke"]
    assert verdict.present and found.clip.count // 2 in verdict.details["frames"]
    assert found.clip.reference not in verdict.details["frames"]
    assert not found.verdicts["motion"].present and found.verdicts["motion"].statistic < 0.9


def test_the_reference_is_the_clear_frame_nearest_the_middle():
    found = reduced_frames(clip("noise"))
    clear = np.ones(found.count, bool)
    assert with_clear_reference(found, clear).reference == found.count // 2
    clear[found.count // 2 - 1 : found.count // 2 + 2] = False
    assert abs(with_clear_reference(found, clear).reference - found.count // 2) == 2
    assert with_clear_reference(found, np.zeros(found.count, bool)).reference == found.count // 2
