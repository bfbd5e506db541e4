"""What a training will need, estimated from settings and the size of the sequence before anything is read whole.

    work(N, P, u) = (0.1 + 0.4 P / (640 512) + 0.5 N / 60 000) (0.65 + 0.35 min(u / 0.35, 1))

is the work of an iteration with N Gaussians and P pixels after the fraction u of the run. Its unit is a late iteration
of the common workload (60 000 Gaussians at 640x512), whose seconds belong to the machine and to the clip: SECONDS where
nothing was timed. The first factor was measured with `endotsr bench` for 10 000 to 90 000 Gaussians at 640x512 and at
320x256 pixels, the second on logs of `sharp` and `quick`: the first iterations have small Gaussians, colours of degree
0 and time bases that are mostly out of reach.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config
from endotsr.kernels.memory import memory_limit
from endotsr.sequences.frame_store import PIXEL_BYTES

TARGET_BYTES = 0.17  # a pixel: what the losses keep of a training frame
BETWEEN_BYTES = 2 * 8.5  # a pixel: the two moments between neighbouring training frames, where they are targets too
PROGRAM_BYTES, IMAGE_BYTES, GAUSSIAN_BYTES = 0.3e9, 0.3e9, 8.7e3  # the rest: program, images of 640x512, a Gaussian
PIXELS, GAUSSIANS = 640 * 512, 60_000  # of the common workload
BASE, OF_PIXELS, OF_GAUSSIANS = 0.1, 0.4, 0.5  # parts of its iteration
EARLY, LATE_FROM = 0.65, 0.35  # part of a late iteration that the first one takes; fraction of the run before late ones
SECONDS = 0.08  # of its iteration on two cores: 0.05 to 0.105 s were measured on three machines without other work
# Assumed growth where `density.growth = "threshold"`, whose last number nobody knows before: a larger weight of the
# similarity makes larger gradients. On the pulling sequence `paper` grew 1.6 times, and 2.0 times with the weight 0.2;
# at half size and twice the threshold the growth was 1.5, 1.8 and 2.1 with the weights 0.2, 0.35 and 0.5.
GROWTH, GROWTH_BY_GRADIENT = 1.2, 8e-4


class Cost(NamedTuple):
    """Estimates for one training."""

    sequence_bytes: float  # of the frames as read
    total_bytes: float  # of memory; frames that lie in a file take none
    file_bytes: float  # of the file of the frames; 0 = they are in memory
    minutes: float  # on two cores
    gaussians: int  # at the end


class Standing(NamedTuple):
    """How far a training is: what decides the work that is left."""

    iteration: int  # completed
    gaussians: int
    coarse: bool = False  # the next iteration sees frames of half size


def at_start(config: Config) -> Standing:
    """Before the first iteration, with all the points that the initialisation asks for; few moved pixels make fewer."""
    points = config.initialisation.first_frame_points + config.initialisation.other_frame_points
    return Standing(0, points, config.training.coarse_start)


def iteration_work(gaussians: float | NDArray, pixels: float | NDArray, progress: float | NDArray) -> float | NDArray:
    """Units of work of one iteration; `progress` is the fraction of the run up to it."""
    early = EARLY + (1 - EARLY) * np.minimum(progress / LATE_FROM, 1.0)
    return (BASE + OF_PIXELS * pixels / PIXELS + OF_GAUSSIANS * gaussians / GAUSSIANS) * early


def gaussians_at_end(config: Config) -> int:
    """The budget of Gaussians, or those at the start times the growth that the gradients let expect."""
    density = config.density
    growth = GROWTH + GROWTH_BY_GRADIENT * config.loss.ssim_weight / density.gradient_threshold
    expected = round(growth * at_start(config).gaussians)
    return density.maximum if density.growth == "budget" else min(expected, density.maximum)


def work_left(config: Config, pixels: int, at: Standing) -> float:
    """Units of work from here to the end.

    pixels   of a frame of full size

    The number of Gaussians is taken to grow evenly up to `density.until`, without what is pruned on the way, and a
    coarse start to last as long.
    """
    later = np.arange(at.iteration + 1, config.training.iterations + 1)
    first, last = max(config.density.start, at.iteration), max(config.density.until, 1)
    goal = max(gaussians_at_end(config), at.gaussians)
    counts = np.interp(later, [first, max(last, first + 1)], [at.gaussians, goal if first < last else at.gaussians])
    seen = np.where(at.coarse & (later <= last), pixels / 4, pixels)
    return float(np.sum(iteration_work(counts, seen, later / config.training.iterations)))


def estimated_cost(count: int, width: int, height: int, config: Config) -> Cost:
    """The cost of a training with these settings on `count` frames of this size, which are read at their `scale`."""
    scale, between = config.sequence.scale, config.training.bridge_fraction > 0
    limit, read = memory_limit(config.sequence.memory), count * width * height * PIXEL_BYTES
    pixels, gaussians = width * height * scale**2, gaussians_at_end(config)
    in_file = read > limit / 2
    kept = min(count * pixels * TARGET_BYTES, limit / 4)
    kept += min(count * pixels * BETWEEN_BYTES, limit / 4) if between else 0.0
    small = pixels * count * PIXEL_BYTES if scale != 1.0 else 0.0  # both sizes exist while frames are scaled
    working = PROGRAM_BYTES + IMAGE_BYTES * pixels / PIXELS + GAUSSIAN_BYTES * gaussians
    total = (0 if in_file else read) + min(small, limit / 2) + kept + working
    minutes = SECONDS * work_left(config, round(pixels), at_start(config)) / 60
    return Cost(read, total, read if in_file else 0.0, minutes, gaussians)
