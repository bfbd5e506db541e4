"""The cost of a training, estimated from the settings and the size of the sequence.

    work(N, P, u) = (0.1 + 0.4 P / (640 * 512) + 0.5 N / 60 000) (0.65 + 0.35 min(u / 0.35, 1))

is the work of an iteration with N Gaussians and P pixels at the fraction u of the run. Its unit is a late iteration of
the common workload (60 000 Gaussians at 640x512), whose time depends on machine and clip: SECONDS without a timing. The
first factor was measured with `endotsr bench` for 10 000 to 90 000 Gaussians at 640x512 and 320x256 pixels, the second
on logs of `sharp` and `quick`: early iterations have small Gaussians, colours of degree 0 and mostly inactive time
bases.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.frame_store import PIXEL_BYTES
from endotsr.config import Config
from endotsr.method.kernels.memory import memory_limit

TARGET_BYTES = 0.17  # per pixel, kept by the losses for a training frame
BETWEEN_BYTES = 2 * 8.5  # per pixel, for two targets between neighbouring training frames
PROGRAM_BYTES, IMAGE_BYTES, GAUSSIAN_BYTES = 0.3e9, 0.3e9, 8.7e3  # the rest: program, images of 640x512, one Gaussian
PIXELS, GAUSSIANS = 640 * 512, 60_000  # of the common workload
BASE, OF_PIXELS, OF_GAUSSIANS = 0.1, 0.4, 0.5  # parts of its iteration
EARLY, LATE_FROM = 0.65, 0.35  # first over late iteration; fraction of the run before late ones
SECONDS = 0.08  # of its iteration on two cores: 0.05 to 0.105 s were measured on three machines without other work
# Assumed growth for `density.growth = "threshold"`, whose final number is not known in advance: a larger weight of the
# similarity gives larger gradients. On the pulling sequence `paper` grew 1.6 times, and 2.0 times with the weight 0.2;
# at half size and twice the threshold the growth was 1.5, 1.8 and 2.1 with the weights 0.2, 0.35 and 0.5.
GROWTH, GROWTH_BY_GRADIENT = 1.2, 8e-4


class Cost(NamedTuple):
    """Estimates for one training."""

    sequence_bytes: float  # of the frames as read
    total_bytes: float  # of memory; frames in a file need none
    file_bytes: float  # of the file with the frames; 0 = in memory
    minutes: float  # on two cores
    gaussians: int  # at the end


class Standing(NamedTuple):
    """The progress of a training, which determines the remaining work."""

    iteration: int  # completed
    gaussians: int
    coarse: bool = False  # the next iteration uses frames of half size


def at_start(config: Config) -> Standing:
    """Progress before the first iteration, with the number of points that the initialisation requests at most."""
    points = config.initialisation.first_frame_points + config.initialisation.other_frame_points
    return Standing(0, points, config.training.coarse_start)


def iteration_work(gaussians: float | NDArray, pixels: float | NDArray, progress: float | NDArray) -> float | NDArray:
    """Work of one iteration; `progress` is the completed fraction of the run."""
    early = EARLY + (1 - EARLY) * np.minimum(progress / LATE_FROM, 1.0)
    return (BASE + OF_PIXELS * pixels / PIXELS + OF_GAUSSIANS * gaussians / GAUSSIANS) * early


def gaussians_at_end(config: Config) -> int:
    """The budget of Gaussians, or the initial number times the growth expected from the gradients."""
    density = config.density
    growth = GROWTH + GROWTH_BY_GRADIENT * config.loss.ssim_weight / density.gradient_threshold
    expected = round(growth * at_start(config).gaussians)
    return density.maximum if density.growth == "budget" else min(expected, density.maximum)


def work_left(config: Config, pixels: int, at: Standing) -> float:
    """Work from here to the end.

    pixels   of a frame of full size

    The number of Gaussians is assumed to grow linearly up to `density.until`, without pruning. A coarse start is
    assumed to last as long.
    """
    later = np.arange(at.iteration + 1, config.training.iterations + 1)
    first, last = max(config.density.start, at.iteration), max(config.density.until, 1)
    goal = max(gaussians_at_end(config), at.gaussians)
    counts = np.interp(later, [first, max(last, first + 1)], [at.gaussians, goal if first < last else at.gaussians])
    seen = np.where(at.coarse & (later <= last), pixels / 4, pixels)
    return float(np.sum(iteration_work(counts, seen, later / config.training.iterations)))


def estimated_cost(count: int, width: int, height: int, config: Config) -> Cost:
    """The cost of a training with these settings on `count` frames of this size, read at `sequence.scale`."""
    scale, between = config.sequence.scale, config.training.bridge_fraction > 0
    limit, read = memory_limit(config.sequence.memory), count * width * height * PIXEL_BYTES
    pixels, gaussians = width * height * scale**2, gaussians_at_end(config)
    in_file = read > limit / 2
    kept = min(count * pixels * TARGET_BYTES, limit / 4)
    kept += min(count * pixels * BETWEEN_BYTES, limit / 4) if between else 0.0
    small = pixels * count * PIXEL_BYTES if scale != 1.0 else 0.0  # both sizes exist during scaling
    working = PROGRAM_BYTES + IMAGE_BYTES * pixels / PIXELS + GAUSSIAN_BYTES * gaussians
    total = (0 if in_file else read) + min(small, limit / 2) + kept + working
    minutes = SECONDS * work_left(config, round(pixels), at_start(config)) / 60
    return Cost(read, total, read if in_file else 0.0, minutes, gaussians)
