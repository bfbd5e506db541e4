"""Time and memory of a configuration relative to the published one, from which a plan derives savings.

Memory is the count of parameters per Gaussian, each stored three times (value and two moments). Time is a table of
measured differences, scaled with the size of each component. `python docs/make.py bench measure effects` repeats the
measurement.
"""

from endotsr.config import PAPER, Config

# Fraction of an iteration of the published settings that each component takes: `docs/pages/bench/effects.py`, file
# docs/results/bench_effects.json (a test compares the two).
MEASURED = {
    "deformation": 0.47,
    "spectral_motion": 0.02,
    "appearance": 0.01,
    "harmonics": 0.01,
    "laplacian": 0.00,
    "depth": 0.01,
    "smoothness": 0.03,
}
ALWAYS = 11  # base parameters of a Gaussian: position, quaternion, log-scale, opacity
CHANNELS = 3


def numbers_of_a_gaussian(config: Config) -> int:
    """Trained parameters per Gaussian."""
    model = config.model
    colours = CHANNELS * (model.harmonics_degree + 1) ** 2
    bases = 3 * 10 * model.bases if model.deformation else 0  # weight, centre, width of ten channels
    residuals = 2 * CHANNELS * model.frequencies * (model.appearance + model.spectral_motion)
    return ALWAYS + colours + bases + residuals


def memory_fraction(config: Config) -> float:
    """Memory of Gaussians and optimiser relative to the published settings, for equal numbers of Gaussians."""
    return numbers_of_a_gaussian(config) / numbers_of_a_gaussian(PAPER)


def time_fraction(config: Config) -> float:
    """Expected time of an iteration relative to the published settings."""
    model, loss = config.model, config.loss
    waves = model.frequencies / PAPER.model.frequencies
    coefficients = ((model.harmonics_degree + 1) ** 2 - 1) / ((PAPER.model.harmonics_degree + 1) ** 2 - 1)
    parts = {
        "deformation": model.deformation * model.bases / PAPER.model.bases,
        "spectral_motion": model.spectral_motion * waves,
        "appearance": model.appearance * waves,
        "harmonics": coefficients,
        "laplacian": float(model.laplacian),
        "depth": float(loss.depth_weight > 0),
        "smoothness": float(loss.smoothness_weight > 0),
    }
    return 1.0 + sum(MEASURED[name] * (size - 1.0) for name, size in parts.items())
