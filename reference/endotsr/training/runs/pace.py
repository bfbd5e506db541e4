"""Settings for a given training time: length, points and Gaussians grow together.

On the settings of `sharp`, `paced(x)` is the preset `quick` at x = 0, and at x = 1 `sharp` on 55 training frames with
growth to a budget. The length is geometric in x, and up to x = 1 the numbers of points and Gaussians are too. The speed
of the machine is measured on the clip itself, with a few iterations of a model without motion.
"""

import statistics
import time

from endotsr.clips.sequences.forecast.seconds import TimedCommand, estimated_seconds, frames_of, vector_factor
from endotsr.clips.sequences.forecast.work import iteration_work
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import QUICK, SHARP, Config, lengthened, with_iterations, with_settings
from endotsr.errors import InputError
from endotsr.training.fitting.state import new_training, training_constants
from endotsr.training.fitting.trainer import training_step

SHARP_LENGTH = lengthened(SHARP, 55).training.iterations  # on 55 training frames
SHORTEST, LONGEST = -1.5, 5.0  # range of x; one more in x is SHARP_LENGTH / the length of `quick` times longer
COARSE_BELOW = 0.5  # largest x with a coarse start at half size
HALVINGS = 20  # of the range in the bisection
WARM, TIMED = 4, 9  # iterations
# Time of a timed iteration relative to a late one of the full model: 0.77 and 0.74 on pulling and cutting with two
# threads, and 0.79 on pulling with one, of an AMD EPYC with AVX-512.
PLAIN = 0.76


def paced(config: Config, x: float) -> Config:
    """The settings with the length, points and Gaussian budget of x; other settings are unchanged."""

    def between(low: int, high: int, at: float) -> int:
        return max(1, round(low * (high / low) ** at))

    growing, quick, sharp = min(x, 1.0), QUICK.initialisation, SHARP.initialisation
    timed = with_iterations(config, between(QUICK.training.iterations, SHARP_LENGTH, x))
    maximum = between(QUICK.density.maximum, SHARP.density.maximum, growing)
    points = {
        name: between(getattr(quick, name), getattr(sharp, name), growing)
        for name in ("first_frame_points", "other_frame_points")
    }
    density, training = {"growth": "budget", "maximum": maximum}, {"coarse_start": x <= COARSE_BELOW}
    return with_settings(timed, density=density, initialisation=points, training=training)


def paced_for(minutes: float, sequence: Sequence, config: Config, unit: float, threads: int) -> Config:
    """The settings with the largest x whose training, with its targets between the frames, takes at most `minutes`.

    unit    seconds per unit of work with these threads, from `seconds_of_unit`
    Raises: InputError if the shortest training takes longer.
    """
    frames, pixels = frames_of(sequence.train_index, sequence.test_index), sequence.width * sequence.height

    def seconds(x: float) -> float:
        plan = TimedCommand(paced(config, x), frames, pixels, threads, vectors=vector_factor())
        return estimated_seconds(plan, unit).training

    low, high = SHORTEST, LONGEST
    if seconds(low) > 60 * minutes:
        raise InputError(
            f"{minutes:g} minutes are not allowed: the shortest training of this clip takes {seconds(low) / 60:.2g} on"
            " this machine; use more minutes, or a smaller scale of the frames"
        )
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if seconds(middle) <= 60 * minutes else (low, middle)
    return paced(config, low)


def seconds_of_unit(sequence: Sequence, config: Config) -> float:
    """Seconds per unit of work on this machine and clip, from a few iterations with compiled kernels."""
    still = with_settings(QUICK.initialisation, motion="none")
    short = with_settings(config, initialisation=still, training={"bridge_fraction": 0.0, "coarse_start": False})
    state, constants, found = new_training(sequence, short), training_constants(sequence, short), []
    state.lambda_lap = state.lambda_lap or 0.0
    pixels, vectors = sequence.width * sequence.height, vector_factor()
    for _ in range(WARM + TIMED):
        began = time.perf_counter()
        training_step(state, constants)
        seconds = time.perf_counter() - began
        found.append(seconds / float(iteration_work(state.gaussians.count, pixels, 1.0, vectors)))
    return statistics.median(found[WARM:]) / PLAIN
