"""Seconds of the parts of `endotsr train`, estimated from the settings, the frames and the speed of the machine.

The unit of `work` has a time that depends on machine and clip: SECONDS without a timing. The constants of the other
parts are in units of one thread at 640x512 pixels. They were measured on the two EndoNeRF clips together with the unit
itself, as processor time of one thread. Nothing is timed here.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.forecast.work import (
    PIXELS,
    Standing,
    at_start,
    calibration_work,
    gaussians_at_end,
    work_left,
)
from endotsr.clips.sequences.splits import split_frames
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import IndexArray

# Of an iteration of `work` on two cores: 0.05 to 0.105 s were measured on four machines without other work.
SECONDS = 0.085
# From the fastest of these to an Intel Xeon, whose two cores probably shared their parts with other work: 0.17 s.
MEASURED_SPEEDS = (0.05 / SECONDS, 0.17 / SECONDS)
# Factor of its time on a processor without AVX-512, whose vectors are half as long: 0.10 to 0.14 s were measured on one
# machine. The parts beside the iterations are assumed to take as long on both.
WITHOUT_AVX512 = 1.5
SERIAL = 1.7  # time of an iteration on one thread over that on several; the other parts use one thread
READ = 0.25  # units per frame: decoding, checks
TRACKED, TRACKED_POINTS = 0.8, 7.5e-6  # units per training frame for the initial motion, and for each of its points
BOTH_WAYS = 0.55  # factor of the initial motion with several threads, which take its two directions at the same time
FLOWS, TARGET = 0.5, 0.8  # units per gap for its two flows, and per time for its target
MEASURED, PERCEIVED = 1.15, 2.2  # units per picture for its metrics, and for LPIPS
TOGETHER = 0.7  # factor of both with several threads, which measure two pictures at a time
METHODS = 9  # pictures per held-out frame: the render, two that are made of renders, and six baselines
# Units per Gaussian for the viewer, the report and the renders. From `quick` to `sharp` on two threads, the evaluation
# grew by 0.0011 on pulling and by 0.0026 on cutting, which has more held-out frames to render.
PAGES = 0.0015
EVERY_TRAINING_FRAME = 6  # one training frame of these is evaluated, without LPIPS
# Frames whose motion is compared with a known truth. The number of pairs would grow with the square of the clip: 300
# frames would have 44 * 299.
MOST_REFERENCES, MOST_TIMES = 12, 64
COMPARED = 1.25  # units per pair of them
COMPARED_TOGETHER = 0.55  # factor with several threads, from one run on two of them
COMPILATION = 30.0  # seconds for the kernels of a training, once per machine


def assumed_unit(threads: int, register: int | None = None) -> float:
    """Seconds per unit of work of a machine whose speed is unknown; register as in `vector_factor`."""
    return SECONDS * (1.0 if threads > 1 else SERIAL) * vector_factor(register)


def vector_factor(register: int | None = None) -> float:
    """The time of an iteration over that with AVX-512. register: bytes of a vector (default: of this processor)."""
    from endotsr.method.kernels import vectors

    return 1.0 if (vectors.REGISTER if register is None else register) >= 64 else WITHOUT_AVX512


class Frames(NamedTuple):
    """Numbers of frames that determine the time of a training."""

    total: int
    training: int
    held_out: int
    times: int  # of targets between the training frames
    compared: int = 0  # pairs of frames between which the true motion is known

    @property
    def gaps(self) -> int:
        """Number of pairs of consecutive training frames."""
        return max(0, self.training - 1)

    def with_true_motion(self) -> "Frames":
        """The numbers for a simulated clip, whose motion is compared with the truth."""
        references = min(-(-self.training // EVERY_TRAINING_FRAME), MOST_REFERENCES)
        return self._replace(compared=references * (min(self.total, MOST_TIMES) - 1))


class Beside(NamedTuple):
    """Seconds per unit of the parts beside the iterations, as they were timed on this machine; None = not yet."""

    start: float | None = None  # the initial motion, as if on one thread
    evaluation: float | None = None  # with the threads of the command


class Speed(NamedTuple):
    """What a machine contributes to the time of a command; the default is an assumed machine."""

    unit: float = SECONDS  # seconds per unit of work with these threads
    threads: int = 2
    perceived: bool = True  # whether it has LPIPS weights for the evaluation
    vectors: float = 1.0  # `vector_factor` of its processor
    beside: Beside = Beside()


ASSUMED = Speed()


class TimedCommand(NamedTuple):
    """One command, as far as its time is concerned."""

    config: Config  # of fixed length
    frames: Frames
    pixels: int  # of a frame of full size
    threads: int = 2  # with more than one, a second thread makes the targets between the frames
    perceived: bool | None = True  # whether the evaluation computes LPIPS; None = no evaluation
    vectors: float = 1.0  # `vector_factor` of the processor
    beside: Beside = Beside()
    unit: float | None = None  # seconds per unit of work, as timed on this machine before; None = not yet

    def alone(self, unit: float) -> float:
        """Seconds per unit of the parts beside the iterations, on one thread: timed, or by `like_iterations`."""
        return self.beside.start or self.like_iterations(unit)

    def like_iterations(self, unit: float) -> float:
        """Seconds per unit on one thread, if libraries are as fast as the iterations.

        unit   seconds per unit of the iterations, with the threads of the plan

        Edges:   AVX-512 is assumed to be no gain for libraries.
        """
        return unit * (SERIAL if self.threads > 1 else 1.0) / self.vectors

    def evaluating(self, unit: float) -> float:
        """Seconds per unit of the evaluation: timed, or the geometric mean of `like_iterations` and of the libraries.

        The libraries have the time of the initial motion, or that of an assumed machine. The mean is a guess. On an
        Intel Xeon the evaluation took 13 to 15 % longer (three runs of `quick` on EndoNeRF pulling).
        """
        libraries = self.beside.start or SECONDS * SERIAL
        return self.beside.evaluation or float(np.sqrt(libraries * self.like_iterations(unit)))


class PartSeconds(NamedTuple):
    """Seconds of the parts of one command, in order."""

    reading: float
    start: float  # initial points and their motion
    calibration: float  # training of the base model for an `auto` weight
    targets: float  # between the frames; the iterations make them at first use
    iterations: float  # without the targets
    evaluation: float  # with report and viewer

    @property
    def training(self) -> float:
        """Seconds of the iterations with their targets, and of the calibration before them."""
        return self.calibration + self.targets + self.iterations


def frames_of(train_index: IndexArray, held_out: IndexArray) -> Frames:
    """The numbers of frames of a split."""
    gaps = np.diff(train_index)
    training, kept = len(train_index), len(held_out)
    return Frames(training + kept, training, kept, int(np.sum(2 * gaps - 1)))


def expected_frames(count: int, config: Config) -> Frames:
    """The numbers of frames of a clip of `count` frames. A clip that the split refuses counts as training frames."""
    try:
        return frames_of(*split_frames(count, config.sequence.split, config.sequence.block_length))
    except InputError:
        return frames_of(np.arange(count), np.arange(0))


def estimated_seconds(plan: TimedCommand, unit: float = SECONDS, at: Standing | None = None) -> PartSeconds:
    """Seconds of the parts of a command.

    unit    seconds per unit of work with the threads of the plan
    at      progress of a training that is resumed; None: a new one
    """
    config, frames, size = plan.config, plan.frames, plan.pixels / PIXELS
    alone, at = plan.alone(unit), at_start(config, plan.pixels) if at is None else at
    sizes = 1.25 if config.training.coarse_start else 1.0
    visits = visited(config, frames.gaps, config.training.iterations - at.iteration)
    targets = sizes * gap_units(frames) * frames.gaps * visits
    return PartSeconds(
        alone * size * READ * frames.total,
        alone * start_units(plan) * (at.iteration == 0),
        unit * calibration_work(config, plan.pixels, at, plan.vectors),
        alone * size * targets / plan.threads,
        unit * work_left(config, plan.pixels, at, plan.vectors),
        plan.evaluating(unit) * evaluation_units(plan),
    )


def start_units(plan: TimedCommand) -> float:
    """Units of the initial motion; 0 without tracked motion."""
    config = plan.config
    tracks = config.initialisation.motion != "none" and config.model.spectral_motion
    points = TRACKED_POINTS * at_start(config, plan.pixels).gaussians
    both = BOTH_WAYS if plan.threads > 1 else 1.0
    return plan.pixels / PIXELS * (TRACKED + points) * tracks * both * plan.frames.training


def evaluation_units(plan: TimedCommand) -> float:
    """Units of the evaluation with its pages; 0 without evaluation."""
    if plan.perceived is None:
        return 0.0
    pictures = plan.frames.held_out * METHODS * (MEASURED + PERCEIVED * plan.perceived)
    pairs = COMPARED * plan.frames.compared
    if plan.threads > 1:
        pictures, pairs = TOGETHER * pictures, COMPARED_TOGETHER * pairs
    pictures += MEASURED * plan.frames.training / EVERY_TRAINING_FRAME + pairs
    return PAGES * gaussians_at_end(plan.config, plan.pixels) + plan.pixels / PIXELS * pictures


def gap_units(frames: Frames) -> float:
    """Mean units per gap for its targets, on one thread at 640x512 pixels."""
    return FLOWS + TARGET * frames.times / max(frames.gaps, 1)


def visited(config: Config, gaps: int, iterations: float) -> float:
    """Expected fraction of the gaps that this number of iterations visits."""
    draws = config.training.bridge_fraction * iterations
    return 1.0 - (1.0 - 1.0 / gaps) ** draws if gaps > 1 else float(gaps > 0 and draws > 0)
