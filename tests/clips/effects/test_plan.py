"""The plan: what it switches off, what it keeps, what the time stamps carry, and that explicit settings win."""

import msgspec
import numpy as np
import pytest
from scenes import clip, inspected

from endotsr.clips.effects.auto import planned_settings
from endotsr.clips.effects.plan import MOST_CONDITION, apply_plan, carried, make_plan, plan_record, with_setting
from endotsr.clips.effects.savings import memory_fraction, numbers_of_a_gaussian, time_fraction
from endotsr.config import PAPER, config_from_dict
from endotsr.method.equations.dictionary import frequencies, report_atoms
from endotsr.training.runs.files import finite

pytestmark = pytest.mark.slow


def planned(*names, config=PAPER, explicit=frozenset(), **more):
    """The plan of a simulated clip and the settings that follow."""
    plan = make_plan(inspected(*names, **more), config, explicit)
    return plan, apply_plan(plan, config)[0]


def test_a_still_clip_keeps_no_component_of_time():
    plan, config = planned("noise")
    model = config.model
    assert not (model.deformation or model.spectral_motion or model.appearance) and model.harmonics_degree == 0
    assert numbers_of_a_gaussian(config) == 14
    assert plan.memory == pytest.approx(1 - 14 / numbers_of_a_gaussian(PAPER))
    assert plan.time >= 0.25
    assert {change.key for change in plan.changes} >= {"model.deformation", "model.appearance", "model.spectral_motion"}


@pytest.mark.parametrize(
    "names, kept",
    [
        (("noise", "exposure"), {"appearance"}),
        (("noise", "brightening"), {"appearance"}),
        (("noise", "pulsation"), {"deformation", "spectral_motion"}),
    ],
)
def test_an_effect_keeps_the_component_that_answers_it(names, kept):
    plan, config = planned(*names, frames=40)
    on = {name for name in ("appearance", "deformation", "spectral_motion") if getattr(config.model, name)}
    assert on == kept
    assert {key.removeprefix("model.") for key, _ in plan.kept} >= kept


def test_motion_without_a_rate_keeps_the_deformation_alone():
    _, config = planned("noise", "pull", frames=40)
    assert config.model.deformation and not config.model.spectral_motion


def test_tracked_motion_keeps_its_carrier():
    """B15 stores the motion along flow in the coefficients of the Fourier translation, whether or not it has a rate."""
    tracked = with_setting(PAPER, "initialisation.motion", "flow")
    plan, config = planned("noise", "pull", frames=40, config=tracked)
    assert config.model.spectral_motion
    assert "flow" in dict(plan.kept)["model.spectral_motion"]
    assert not planned("noise", config=tracked)[1].model.spectral_motion  # without motion there is nothing to carry


def test_fewer_harmonics_keep_the_step_of_the_displayed_colour():
    """One Adam step of all 16 coefficients along their signs, seen from one pixel, against one of the first alone."""
    from endotsr.clips.effects.views import harmonic_design, harmonic_sizes

    config = planned("noise")[1]
    rates = np.full(16, PAPER.optimiser.harmonics_rest)
    rates[0] = PAPER.optimiser.harmonics_base
    step = rates @ harmonic_sizes(inspected("noise").clip)
    assert config.optimiser.harmonics_base * 0.28209479177387814 == pytest.approx(step, rel=1e-3)
    ahead = np.abs(harmonic_design(np.array([[0.0, 0.0, 1.0]]), 3)[0])
    assert np.flatnonzero(ahead > 1e-12).tolist() == [0, 2, 6, 12]  # along z the other harmonics vanish
    assert PAPER.optimiser.harmonics_base * 1.2 < config.optimiser.harmonics_base < PAPER.optimiser.harmonics_base * 2
    same = planned("noise", explicit=frozenset({"optimiser.harmonics_base"}))[1]
    assert same.optimiser.harmonics_base == PAPER.optimiser.harmonics_base
    assert planned("noise", explicit=frozenset({"model.harmonics_degree"}))[1].optimiser == PAPER.optimiser


def test_a_plan_never_switches_on_and_never_enlarges():
    small = config_from_dict({"model": {"appearance": False, "exposure": True, "bases": 5, "frequencies": 2}})
    for names in (("noise", "exposure"), ("noise", "pulsation"), ("noise",)):
        _, config = planned(*names, config=small)
        assert not config.model.appearance
        assert config.model.bases <= 5 and config.model.frequencies <= 2
    assert not planned("noise", config=small)[1].model.exposure
    assert planned("noise", "exposure", config=small)[1].model.exposure


def test_moving_tissue_keeps_the_harmonics():
    assert planned("noise", "breathing")[1].model.harmonics_degree == 3
    assert planned("noise", "breathing")[1].optimiser == PAPER.optimiser
    assert planned("noise", "highlights")[1].model.harmonics_degree == 0
    assert planned("noise", "camera_motion", amplitude=9.0)[1].model.harmonics_degree == 1


def test_explicit_settings_win_and_both_are_said():
    explicit = frozenset({"model.appearance", "model.harmonics_degree"})
    plan, config = planned("noise", explicit=explicit)
    assert config.model.appearance and config.model.harmonics_degree == PAPER.model.harmonics_degree
    assert not config.model.deformation
    lines = apply_plan(plan, PAPER)[1]
    (said,) = [line for line in lines if line.startswith("model.appearance")]
    assert "true is kept as given" in said and "the plan has false" in said
    given = {change.key: change for change in plan.changes if change.given}
    assert set(given) == explicit and all(change.time == change.memory == 0 for change in given.values())
    assert plan.memory == pytest.approx(1 - memory_fraction(config))


def test_depth_without_use_turns_its_losses_off():
    import dataclasses

    from endotsr.clips.effects.inspect import inspect_sequence

    sequence = clip("noise")
    fields = {f.name: getattr(sequence, f.name) for f in dataclasses.fields(sequence) if f.init}
    blind = type(sequence)(**(fields | {"depth": np.zeros_like(sequence.depth)}))
    plan = make_plan(inspect_sequence(blind), PAPER)
    config, _ = apply_plan(plan, PAPER)
    assert config.loss.depth_weight == config.loss.smoothness_weight == 0.0


@pytest.mark.parametrize("frames", [9, 16, 24, 40])
def test_the_dictionary_is_what_the_stamps_carry(frames):
    """Full rank, bounded condition, no frequency beyond half the frames; nothing changes where all is well."""
    found = inspected("noise", "exposure", frames=frames)
    dictionary = carried(found, PAPER)
    omega = frequencies(dictionary.frequencies, 1.0, dictionary.frequency_max)
    report = report_atoms(found.clip.times, omega)
    assert report.rank == dictionary.rank == 2 * dictionary.frequencies
    assert report.condition == dictionary.condition <= MOST_CONDITION
    assert dictionary.frequency_max <= frames / 2
    assert (frames < 33) == (dictionary.frequency_max < 16)


def test_a_clip_of_two_training_frames_has_a_plan():
    plan = make_plan(inspected("noise", "exposure", frames=3), PAPER)
    assert plan.dictionary.frequencies == 1


def test_savings_of_the_changes_add_up():
    for names in (("noise",), ("noise", "pulsation"), ("noise", "exposure")):
        plan, config = planned(*names)
        assert sum(change.time for change in plan.changes) == pytest.approx(1 - time_fraction(config))
        assert sum(change.memory for change in plan.changes) == pytest.approx(1 - memory_fraction(config))
        assert all(change.time >= 0 and change.memory >= 0 for change in plan.changes)


def test_full_settings_have_the_time_and_memory_of_the_published_ones():
    assert time_fraction(PAPER) == memory_fraction(PAPER) == 1.0
    half = with_setting(with_setting(PAPER, "model.harmonics_degree", 1), "model.bases", 9)
    assert numbers_of_a_gaussian(half) == 11 + 12 + 270 + 96


def test_the_record_is_json_and_names_the_plan():
    config, lines, record = planned_settings(clip("noise"), PAPER)
    assert config == planned("noise")[1]
    assert lines[0].startswith("effects: auto") and any(
        "model.deformation = false (was true)" in line for line in lines
    )
    assert finite(record) == msgspec.json.decode(msgspec.json.encode(finite(record)))
    assert record["plan"] == plan_record(planned("noise")[0])


def test_masks_without_an_excluded_pixel_are_remarked():
    assert any("mask propagation" in remark for remark in planned("noise")[0].remarks)
    assert not any("mask propagation" in remark for remark in planned("noise", "instrument")[0].remarks)
