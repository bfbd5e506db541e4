"""Schedules: the values at the milestones and on both sides of them."""

import msgspec
import pytest

from endotsr.config import (
    PAPER,
    PRESETS,
    QUICK,
    Config,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    with_iterations,
    with_settings,
)
from endotsr.training.fitting import schedules
from endotsr.training.fitting.schedules import learning_rates


def changed(section: str, **values) -> Config:
    return msgspec.structs.replace(PAPER, **{section: msgspec.structs.replace(getattr(PAPER, section), **values)})


def test_exponential_decay_end_points_middle_and_clip():
    decay = schedules.exponential_decay
    assert decay(0, 6000, 1.6e-3, 1.6e-5) == 1.6e-3
    assert decay(6000, 6000, 1.6e-3, 1.6e-5) == pytest.approx(1.6e-5, rel=1e-14)
    assert decay(3000, 6000, 1.6e-3, 1.6e-5) == pytest.approx(1.6e-4, rel=1e-14)
    assert decay(9000, 6000, 1.0, 0.01) == pytest.approx(0.01, rel=1e-14)
    assert decay(-5, 6000, 1.0, 0.01) == 1.0
    assert decay(1, 0, 1.0, 0.01) == pytest.approx(0.01) and decay(1, -3, 1.0, 0.01) == pytest.approx(0.01)
    assert decay(0, 0, 1.0, 0.01) == decay(-2, -3, 1.0, 0.01) == 1.0, "nothing is annealed that begins after the end"
    assert decay(0, 1, 1.0, 0.01) == 1.0
    assert decay(1, 10, 0.0, 0.0) == decay(1, 10, 1.0, 0.0) == decay(0, 10, 1.0, 0.0) == decay(0, 10, 0.0, 1.0) == 0.0


def test_rates_of_the_paper_preset():
    rates = schedules.learning_rates(6000, PAPER)
    assert rates["position"] == pytest.approx(1.6e-5)
    assert rates["fdm_centre"] == rates["fdm_width"] == pytest.approx(1.6e-5)
    assert rates["fdm_weight"] == ((slice(0, 3), rates["fdm_centre"]), (slice(3, 10), rates["fdm_centre"]))
    assert rates["harmonics"] == ((slice(0, 1), 2.5e-3), (slice(1, None), 1.25e-4))
    assert (rates["opacity_logit"], rates["log_scale"], rates["quaternion"]) == (0.05, 0.005, 0.001)


def assert_rates_of_a_part(part, rate, names):
    """Only a model with this part has them; they decay like that of the position."""
    config = changed("model", **{part: True})
    start, last = (learning_rates(i, config) for i in (0, config.training.iterations))
    for name in names:
        assert start[name] == rate > 0 and last[name] == pytest.approx(rate * config.optimiser.final_factor)
        assert name not in learning_rates(0, PAPER)


def test_corrections_of_poses_have_a_rate_only_where_the_model_has_them_and_decay_like_the_position():
    assert_rates_of_a_part("pose_correction", PAPER.optimiser.pose, ("pose_rotation", "pose_translation"))


def test_exposure_has_a_rate_only_where_the_model_has_it_and_decays_like_the_position():
    assert_rates_of_a_part("exposure", PAPER.optimiser.exposure, ("exposure_log_gain", "exposure_bias"))


def test_residuals_start_after_the_activation_with_the_rates_of_the_paper():
    assert not schedules.residuals_active(3000, PAPER)
    assert schedules.residuals_active(3001, PAPER)
    assert [i for i in range(2990, 3010) if schedules.residuals_activate(i, PAPER)] == [3001]
    assert "motion_coefficients" not in schedules.learning_rates(3000, PAPER)
    decay = 0.01 ** (1 / 3000)
    rates = schedules.learning_rates(3001, PAPER)
    assert rates["motion_coefficients"] == pytest.approx(1.6e-4 * decay)
    assert rates["appearance_coefficients"] == pytest.approx(3.125e-3 * decay)
    last = schedules.learning_rates(6000, PAPER)
    assert last["motion_coefficients"] == pytest.approx(1.6e-6)


def test_residual_schedule_not_restarted_continues_the_base_decay():
    config = changed("optimiser", restart_residual_schedule=False)
    assert schedules.residual_decay(3000, config) == pytest.approx(0.1)
    assert schedules.residual_decay(3000, PAPER) == 1.0
    assert schedules.residual_decay(6000, config) == pytest.approx(schedules.residual_decay(6000, PAPER))


def test_a_model_without_residuals_never_activates_them():
    config = Config(model=ModelConfig(appearance=False, spectral_motion=False))
    assert not schedules.residuals_active(5000, config)
    assert not any(schedules.residuals_activate(i, config) for i in (3000, 3001, 3002))


@pytest.mark.parametrize("alone", ["appearance", "spectral_motion"])
def test_one_residual_is_enough_to_activate(alone):
    model = {"appearance": False, "spectral_motion": False} | {alone: True}
    config = Config(model=ModelConfig(**model))
    assert schedules.residuals_active(5000, config) and not schedules.residuals_active(3000, config)


def test_residuals_from_the_first_iteration():
    config = changed("training", residual_activation=0)
    assert schedules.residuals_activate(1, config)


def test_detail_ramp():
    share = schedules.laplacian_ramp
    assert share(1000, PAPER) == 0.0
    assert share(1001, PAPER) == pytest.approx(1 / 1500)
    assert share(1750, PAPER) == pytest.approx(0.5)
    assert share(2499, PAPER) < 1.0
    assert share(2500, PAPER) == share(6000, PAPER) == 1.0
    step = Config(loss=LossConfig(laplacian_from=100, laplacian_full=100))
    assert (share(100, step), share(101, step)) == (0.0, 1.0)
    assert share(6000, Config(model=ModelConfig(laplacian=False))) == 0.0


def test_smoothness_and_degree():
    assert not schedules.smoothness_active(1000, PAPER)
    assert schedules.smoothness_active(1001, PAPER)
    assert not schedules.smoothness_active(2000, Config(loss=LossConfig(smoothness_weight=0.0)))
    assert [schedules.active_degree(i, PAPER) for i in (1, 499, 500, 999, 1000, 1500, 6000)] == [0, 0, 1, 1, 2, 3, 3]
    assert schedules.active_degree(6000, Config(model=ModelConfig(harmonics_degree=1))) == 1


def test_densify_iterations():
    found = [i for i in range(1, 6001) if schedules.densify_now(i, PAPER)]
    assert found == list(range(600, 4000, 100))
    assert schedules.statistics_active(3999, PAPER)
    assert not schedules.statistics_active(4000, PAPER)


def test_densifications_that_are_left():
    left = [schedules.densifications_left(i, PAPER) for i in range(1, 6001) if schedules.densify_now(i, PAPER)]
    assert left == list(range(34, 0, -1))
    assert schedules.densifications_left(6000, PAPER) == 1
    longer = changed("density", until=3901)  # the last iteration before it densifies
    assert schedules.densify_now(3900, longer) and schedules.densifications_left(3800, longer) == 2


def test_stretched_run_keeps_its_shares():
    short = with_iterations(PAPER, 600)
    assert schedules.residuals_activate(301, short)
    assert schedules.laplacian_ramp(250, short) == 1.0
    assert schedules.learning_rates(600, short)["position"] == pytest.approx(1.6e-5)


def test_position_channels_of_the_deformation_can_have_an_extra_factor():
    config = Config(optimiser=OptimiserConfig(deformation_position_factor=10.0))
    rates = schedules.learning_rates(1, config)
    (_, position), (_, rest) = rates["fdm_weight"]
    assert position == pytest.approx(10 * rest)


def test_annealed_rates_are_constant_and_then_fall_to_their_factor():
    config = changed("optimiser", annealed_factor=0.05, annealing_from=4000)
    before, middle, end = (learning_rates(i, config) for i in (4000, 5000, 6000))
    paper = learning_rates(6000, PAPER)
    for name in ("quaternion", "log_scale", "opacity_logit"):
        assert before[name] == paper[name]
        assert end[name] == pytest.approx(0.05 * paper[name]) and middle[name] == pytest.approx(0.05**0.5 * paper[name])
    assert [rate for _, rate in end["harmonics"]] == pytest.approx([0.05 * rate for _, rate in paper["harmonics"]])
    assert {name: end[name] for name in ("position", "fdm_weight", "fdm_centre")} == {
        name: paper[name] for name in ("position", "fdm_weight", "fdm_centre")
    }


def test_tracked_motion_is_trained_from_the_first_iteration_at_a_constant_rate_until_the_activation():
    config = changed("initialisation", motion="flow")
    first, last, later = (learning_rates(i, config)["motion_coefficients"] for i in (1, 3000, 4500))
    assert first == last == pytest.approx(1.6e-4) and later < last
    assert "appearance_coefficients" not in learning_rates(3000, config)
    without = msgspec.structs.replace(config, model=msgspec.structs.replace(config.model, spectral_motion=False))
    assert "motion_coefficients" not in learning_rates(1, without)


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        ("training", {"residual_activation": 6000}, ["the residuals of A and S (training.residual_activation = 6000)"]),
        ("loss", {"laplacian_from": 6000, "laplacian_full": 6000}, ["the Laplacian loss (loss.laplacian_from = 6000)"]),
        ("loss", {"smoothness_from": 6001}, ["the smoothness (loss.smoothness_from = 6001)"]),
        (
            "density",
            {"start": 600, "until": 700},
            ["a densification (density.start = 600, until = 700, interval = 100)"],
        ),
        ("density", {"start": 500, "until": 601}, []),
        ("density", {"until": 0}, []),
        ("optimiser", {"annealed_factor": 0.1, "annealing_from": 6000}, ["the annealing (optimiser.annealing_from"]),
        ("optimiser", {"annealing_from": 6000}, []),
        (
            "training",
            {"harmonics_interval": 6001},
            ["a harmonic degree above 0 (training.harmonics_interval = 6001)"],
        ),
    ],
)
def test_what_a_run_is_too_short_for_is_named(section, values, said):
    found = schedules.phases_never_reached(changed(section, **values))
    assert len(found) == len(said) and all(a.startswith(b) for a, b in zip(found, said))


@pytest.mark.parametrize("name", PRESETS)
def test_no_preset_is_too_short_for_its_parts(name):
    assert schedules.phases_never_reached(PRESETS[name]) == []


def test_tracked_motion_and_parts_that_are_off_are_not_missed():
    late = {"training": {"iterations": 100}}
    tracked = with_settings(PAPER, initialisation={"motion": "flow"}, **late)
    assert "the residuals of A (training" in schedules.phases_never_reached(tracked)[0]
    off = {"appearance": False, "spectral_motion": False, "laplacian": False, "harmonics_degree": 0}
    bare = with_settings(PAPER, model=off, loss={"smoothness_weight": 0.0}, density={"until": 0}, **late)
    assert schedules.phases_never_reached(bare) == []
    coarse = with_settings(QUICK, density={"until": 0})
    assert schedules.phases_never_reached(coarse) == ["the coarse start, which ends at density.until = 0"]


def test_tracked_motion_without_an_activation_keeps_its_first_rate():
    config = with_settings(PAPER, initialisation={"motion": "flow"}, training={"residual_activation": 6000})
    first = PAPER.optimiser.deformation * PAPER.optimiser.spectral_motion_factor
    for iteration in (1, 3000, 6000):
        rates = learning_rates(iteration, config)
        assert rates["motion_coefficients"] == first and "appearance_coefficients" not in rates


def test_milestones_round_halves_to_even():
    """9 of 6000 iterations: 1.5 rounds to 2, and 4.5 to 4."""
    short = with_iterations(PAPER, 9)
    assert (short.loss.laplacian_from, short.training.residual_activation) == (2, 4)
