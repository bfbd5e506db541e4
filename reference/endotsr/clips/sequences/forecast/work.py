"""Work of the iterations of a training, estimated from the settings and the number of Gaussians.

    work(N, P, u) = (b + p P / (640 * 512) + n N / 60 000) (0.77 + 0.23 min(u / 0.35, 1))

is the work of an iteration with N Gaussians and P pixels at the fraction u of the run. Its unit is a late iteration of
the common workload (60 000 Gaussians at 640x512), whose time `seconds` states. b, p and n depend on the machine. On
processors with AVX-512 `endotsr bench` gave 0.1, 0.4 and 0.5 on one and 0.06, 0.3 and 0.64 on another (10 000 to 90 000
Gaussians at 640x512 and 320x256 pixels); their mean is assumed. Without it, 0.02, 0.36 and 0.62 follow from the times
of a `quick` run on pulling before and after the end of its coarse start, and from those of a `sharp` run on cutting
with 36 900 and with 80 000 Gaussians.
The second factor was measured on `quick` with and without its coarse start, on both EndoNeRF clips: early iterations
have small Gaussians, colours of degree 0 and mostly inactive time bases.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config

PIXELS, GAUSSIANS = 640 * 512, 60_000  # of the common workload
PARTS = (0.08, 0.35, 0.57)  # of its iteration: constant, of the pixels, of the Gaussians; on a processor with AVX-512
PARTS_WITHOUT = (0.02, 0.36, 0.62)  # and on one without
EARLY, LATE_FROM = 0.77, 0.35  # first over late iteration; fraction of the run before late ones
# Assumed growth for `density.growth = "threshold"`, whose final number is not known in advance: a larger weight of the
# similarity gives larger gradients. On the pulling sequence `paper` grew 1.6 times, and 2.0 times with the weight 0.2;
# at half size and twice the threshold the growth was 1.5, 1.8 and 2.1 with the weights 0.2, 0.35 and 0.5.
GROWTH, GROWTH_BY_GRADIENT = 1.2, 8e-4
SEEN_ENOUGH = 0.2  # root of the fraction of the growing time after which the observed growth replaces the assumed one


class Standing(NamedTuple):
    """The progress of a training, which determines the remaining work."""

    iteration: int  # completed
    gaussians: int
    coarse: bool = False  # the next iteration uses frames of half size
    coarse_until: int = 0  # and later ones, to this iteration; 0: to `density.until`


def at_start(config: Config, pixels: float = inf) -> Standing:
    """Progress before the first iteration, with the largest number of points that the initialisation can draw.

    pixels   of a frame of full size: the first frame gives a point per pixel at most
    """
    asked = config.initialisation
    points = round(min(asked.first_frame_points, pixels)) + asked.other_frame_points
    return Standing(0, points, config.training.coarse_start)


def coarse_end(config: Config, at: Standing) -> int:
    """The iteration to which a coarse start is expected to last: by its forecast, or `density.until` without one."""
    return at.coarse_until or config.density.until


def iteration_work(
    gaussians: float | NDArray, pixels: float | NDArray, progress: float | NDArray, vectors: float = 1.0
) -> float | NDArray:
    """Work of one iteration; `progress` is the completed fraction of the run, `vectors` the `vector_factor`."""
    early = EARLY + (1 - EARLY) * np.minimum(progress / LATE_FROM, 1.0)
    constant, of_pixels, of_gaussians = PARTS if vectors == 1.0 else PARTS_WITHOUT
    return (constant + of_pixels * pixels / PIXELS + of_gaussians * gaussians / GAUSSIANS) * early


def gaussians_at_end(config: Config, pixels: float = inf) -> int:
    """The budget of Gaussians, or the initial number (`at_start`) times the growth expected from the gradients."""
    density = config.density
    expected = round(growth_by_threshold(config) * at_start(config, pixels).gaussians)
    return density.maximum if density.growth == "budget" else min(expected, density.maximum)


def growth_by_threshold(config: Config) -> float:
    """Expected factor from the initial number of Gaussians to the final one, without a limit."""
    return GROWTH + GROWTH_BY_GRADIENT * config.loss.ssim_weight / config.density.gradient_threshold


def work_left(config: Config, pixels: int, at: Standing, vectors: float = 1.0, until: int | None = None) -> float:
    """Work from here to the end, with the numbers of `expected_gaussians`.

    pixels    of a frame of full size
    vectors   `vector_factor` of the processor
    until     the last iteration; None = of the run

    A coarse start is assumed to last until `coarse_end`.
    """
    later = np.arange(at.iteration + 1, (until or config.training.iterations) + 1)
    seen = np.where(at.coarse & (later <= max(coarse_end(config, at), 1)), pixels / 4, pixels)
    counts = expected_gaussians(config, at, later, pixels)
    return float(np.sum(iteration_work(counts, seen, later / config.training.iterations, vectors)))


def calibration_work(config: Config, pixels: int, at: Standing, vectors: float = 1.0) -> float:
    """Work of the base model on which equation (7) calibrates an `auto` weight, before the first iteration; else 0."""
    if at.iteration or config.loss.lambda_lap != "auto" or not config.model.laplacian:
        return 0.0
    return work_left(config, pixels, at._replace(coarse=False), vectors, config.training.residual_activation)


def expected_gaussians(
    config: Config, at: Standing, later: NDArray[np.integer], pixels: float = inf
) -> NDArray[np.floating]:
    """Expected number of Gaussians at later iterations, without pruning; pixels as in `at_start`.

    A budget is approached linearly between `density.start` and `density.until`. By the threshold, the number grows with
    the square root of the time between them, up to `density.maximum`: on EndoNeRF cutting from 36 900 to 160 100
    without that limit, within 5 % of this curve.
    """
    density, initial = config.density, at_start(config, pixels).gaussians
    last = max(density.until, density.start + 1)
    place, places = (np.clip((i - density.start) / (last - density.start), 0.0, 1.0) for i in (at.iteration, later))
    budget, goal = density.growth == "budget", max(gaussians_at_end(config, pixels), at.gaussians)
    if not budget:
        place, places = np.sqrt(place), np.sqrt(places)
        uncapped = initial * growth_by_threshold(config)
        if place > SEEN_ENOUGH:
            uncapped = initial + (at.gaussians - initial) / place
        goal = max(uncapped, at.gaussians)
    rise = (places - place) / (1.0 - place) if place < 1.0 else np.zeros(len(later))
    return np.minimum(at.gaussians + rise * (goal - at.gaussians), max(density.maximum, at.gaussians))
