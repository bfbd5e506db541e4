"""The small training of the definition: it learns, and the fast path takes the same steps from the same start."""

import subprocess
import sys

import numpy as np
import pytest

from endotsr.clips.opencv.filters import canny_edges
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    TrainingConfig,
    config_from_dict,
)
from endotsr.definition import schedules as definition_schedules
from endotsr.definition import train
from endotsr.definition.calibration import calibration_views as calibration_views_by_definition
from endotsr.definition.initialisation import drawn_pixels, neighbour_distance
from endotsr.definition.initialisation import initialise as initialise_by_definition
from endotsr.definition.scene import spectral_from
from endotsr.definition.settings import PAPER, PAPER_CONFIG, SMALL
from endotsr.definition.simulate import simulate
from endotsr.method.equations.calibration import calibration_views
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.settings import PAPER as FAST_PAPER
from endotsr.training.fitting import schedules
from endotsr.training.fitting.adam import rate_parts
from endotsr.training.fitting.state import fresh_state, training_constants
from endotsr.training.fitting.trainer import training_step
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import initialise, squared_neighbour_distance, training_points
from makers.twins import scaled

STEPS = 50
LOSS_BOUND, ARRAY_BOUND = 1e-13, 1e-10  # relative to the loss, and to the largest entry of an array

# Everything that the training of the paper does happens within the first 50 iterations.
SHORT = SMALL._replace(
    loss=SMALL.loss._replace(smoothness_from=5, laplacian_from=3, laplacian_full=20),
    density=SMALL.density._replace(start=15, interval=20, until=45),
    training=SMALL.training._replace(residual_activation=25, harmonics_interval=12),
)


def fast_config(config):
    """The same settings as the package takes them."""
    return Config(
        model=ModelConfig(**config.model._asdict()),
        loss=LossConfig(**config.loss._asdict()),
        optimiser=OptimiserConfig(**config.optimiser._asdict()),
        density=DensityConfig(**config.density._asdict()),
        initialisation=InitialisationConfig(**config.initialisation._asdict()),
        training=TrainingConfig(precision="float64", **config.training._asdict()),
    )


def fast_sequence(sequence):
    cameras = [Camera(*camera) for camera in sequence.cameras]
    names = [str(k) for k in range(len(sequence.images))]
    return Sequence(
        sequence.images, sequence.masks, sequence.depth, sequence.times, cameras, names, "scene unit", True,
        sequence.train_index, sequence.test_index,
    )  # fmt: skip


@pytest.fixture(scope="module")
def start():
    """Sequence, configuration and Gaussians; these are not round, because a round one has no gradient to turn by."""
    sequence, rng = simulate(), np.random.default_rng(1)
    made = initialise_by_definition(sequence, SHORT.initialisation, SHORT.model, rng)
    made = made._replace(
        log_scale=made.log_scale + rng.normal(0, 0.3, made.log_scale.shape),
        quaternion=made.quaternion + rng.normal(0, 0.3, made.quaternion.shape),
        fdm_weight=rng.normal(0, 0.01, made.fdm_weight.shape),
    )
    return sequence, made


def test_the_settings_of_the_definition_are_those_of_paper():
    fast = fast_config(PAPER_CONFIG)
    assert fast == Config(training=TrainingConfig(precision="float64"))
    assert PAPER[:7] == FAST_PAPER[:7] and not any(PAPER.deviations)


@pytest.mark.parametrize("preset", ["paper", "sharp", "quick", "demo"])
def test_the_schedules_of_every_preset_are_the_same(preset):
    config = config_from_dict({"preset": preset})
    for i in range(1, config.training.iterations + 100, 7):
        fast, written = schedules.learning_rates(i, config), definition_schedules.learning_rates(i, config)
        for name in written:
            assert np.ravel([r for _, r in rate_parts(written[name])]) == pytest.approx(
                [r for _, r in rate_parts(fast[name])], rel=1e-14
            ), (i, name)
        assert fast.keys() - written.keys() <= {"motion_coefficients"}, "(B15) trains it from the first iteration on"
        assert schedules.laplacian_ramp(i, config) == definition_schedules.laplacian_ramp(i, config)
        assert schedules.densifications_left(i, config) == definition_schedules.densifications_left(i, config)


def test_the_views_of_the_calibration_are_the_same():
    for n_train in (1, 2, 5, 16, 17, 55, 138):
        np.testing.assert_array_equal(calibration_views(n_train, 16), calibration_views_by_definition(n_train, 16))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 30])
def test_the_distance_to_the_neighbours_is_the_same(count):
    position = np.random.default_rng(count).normal(size=(3, count))
    wanted = squared_neighbour_distance(position)
    np.testing.assert_allclose(neighbour_distance(position), wanted, rtol=1e-13, atol=0)


def test_the_same_frames_of_a_long_clip_are_visited():
    """152 frames, the first of them held out: every second one counts from the first training frame."""
    small = simulate(width=4, height=3, frames=152)
    small = small._replace(train_index=np.arange(1, 152, 3), test_index=np.zeros(1, int))
    settings = SMALL.initialisation._replace(motion_threshold=1e-9, other_frame_points=152)
    written = drawn_pixels(small, settings, np.random.default_rng(0))
    visited = {int(k) for k, pixels in written if pixels.size}
    config = fast_config(SMALL._replace(initialisation=settings))
    fast = training_points(fast_sequence(small), config.initialisation, np.random.default_rng(0))
    assert visited == set(small.train_index[np.unique(fast.start)].tolist()) and 10 < len(visited) < 51


def test_the_fast_path_starts_with_the_same_gaussians():
    sequence = simulate()
    made = initialise_by_definition(sequence, SHORT.initialisation, SHORT.model, np.random.default_rng(3))
    config = fast_config(SHORT)
    rng = np.random.default_rng(3)
    fast = initialise(fast_sequence(sequence), config.initialisation, config.model, rng, np.float64)
    assert fast.count > 150
    for name, array in arrays(fast).items():
        np.testing.assert_allclose(getattr(made, name), array, rtol=0, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("growth, maximum", [("threshold", 300), ("budget", 220)])
def test_the_fast_path_takes_the_same_steps(start, growth, maximum):
    """Fifty iterations with the same draws, through density control and the activation of the residuals."""
    sequence, made = start
    settings = SHORT._replace(density=SHORT.density._replace(growth=growth, maximum=maximum))
    config = fast_config(settings)
    constants = training_constants(fast_sequence(sequence), config)
    fast = Gaussians(
        **{name: np.array(array, order="C") for name, array in made._asdict().items() if array is not None}
    )
    fast_state = fresh_state(fast, None, np.random.default_rng(7), lambda_lap=config.loss.lambda_lap)
    state, rng = train.start(made), np.random.default_rng(7)
    spectral = spectral_from(settings.model, sequence.times[sequence.train_index])
    counts = set()
    for iteration in range(1, STEPS + 1):
        state, view = train.iterate(state, sequence, spectral, settings, rng, edges=canny_edges)
        entry = training_step(fast_state, constants)
        counts.add(entry["gaussians"])
        print(f"iteration {iteration:2d}  definition {view.loss:.16f}  fast path {entry['loss']:.16f}")
        assert entry["loss"] == pytest.approx(view.loss, rel=LOSS_BOUND), iteration
        assert set(view.terms) <= set(entry)
    assert len(counts) > 1, "no density control"
    assert growth == "threshold" or max(counts) == maximum
    found, wanted = arrays(fast_state.gaussians), train.arrays(state.gaussians)
    assert found.keys() == wanted.keys() and {"appearance_coefficients", "motion_coefficients"} <= found.keys()
    off = {name: scaled(found[name], wanted[name], "max") for name in wanted}
    print(off)
    assert {name: value for name, value in off.items() if value > ARRAY_BOUND} == {}
    np.testing.assert_array_equal(fast_state.statistics.visits, state.statistics.visits)
    for name, (first, second, step) in state.adam.items():
        assert fast_state.adam.step[name] == step
        assert scaled(fast_state.adam.first[name], first, "max") <= ARRAY_BOUND, name
        assert scaled(fast_state.adam.second[name], second, "max") <= ARRAY_BOUND, name


def test_the_small_training_learns():
    """40 of its 300 iterations: the loss falls, and the render comes nearer to the held-out frames."""
    sequence, losses = simulate(), []
    config = SMALL._replace(training=SMALL.training._replace(iterations=40))
    before = train.train(
        sequence, config._replace(training=config.training._replace(iterations=0)), np.random.default_rng(0)
    )
    after = train.train(
        sequence, config, np.random.default_rng(0), on_iteration=lambda state, view: losses.append(view.loss)
    )
    assert len(losses) == 40 and np.mean(losses[-5:]) < 0.5 * losses[0]
    one, other = (train.evaluate(*model, sequence, config, sequence.test_index) for model in (before, after))
    assert other > one + 3


def test_the_command_prints_iteration_and_loss():
    code = (
        "import endotsr.definition.settings as s; s.SMALL = s.SMALL._replace(training=s.SMALL.training._replace("
        "iterations=2)); import runpy; runpy.run_module('endotsr.definition', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, *_, last = done.stdout.splitlines()
    assert first.startswith("iteration    1  loss 0.7") and last.startswith("held-out PSNR over tissue: ")
