"""All settings of a run in one typed, frozen tree; the defaults are the published schedule (preset `paper`).

`load_config` reads TOML; an unknown key or a wrong type raises an `InputError` with the key and the allowed values.
Iterations count from 1. Lengths are in scene units (millimetres for EndoNeRF).
"""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import choice
from endotsr.untrusted.sections import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    PositiveCount,
    Section,
    SectionType,
    checked,
    refuse_unknown_keys,
)
from endotsr.untrusted.toml import read_toml, toml_text

LARGEST_SEED = (1 << 53) - 1  # of a seed, which JSON records: it keeps only some larger integers
NO_DENSIFICATION = 1  # largest `density.until` with which no iteration densifies: they count from 1


DecayRate = Annotated[float, msgspec.Meta(ge=0, lt=1)]  # at 1 the bias correction of a moment divides by 0
PERCENTILES = "percent, 0 <= low < 50 < high <= 100"


def enclose_median(low: float, high: float) -> bool:
    """Whether percentiles may limit depth: beyond the median, one number would replace most of the depth."""
    return 0 <= low < 50 < high <= 100


class SequenceConfig(Section, frozen=True, kw_only=True):
    """Frames, masks and depth of a sequence folder."""

    masks: Literal["masks", "gt_masks", "none"] = "masks"
    """mask folder: `masks` = instrument and every pixel without depth, `gt_masks` = instrument only, `none`"""
    excluded_value: Literal["white", "black"] = "white"
    """mask value of excluded pixels on disk (EndoNeRF: white)"""
    allow_tissue_fraction: bool = False
    """accept a tissue fraction below 5 % or of exactly 100 %, and masks that the pictures or other masks contradict"""
    frames: str = ""
    """frame range start:stop[:step] in Python slice notation; empty = all"""
    scale: Positive = 1.0
    """image scale, area-averaged; 0.5 halves width and height"""
    split: Literal["every_eighth", "every_second", "blocks", "end"] = "every_eighth"
    """held-out frames: (i - 1) % 8 == 0, every second frame, contiguous blocks, or the end of the clip"""
    block_length: PositiveCount = 8
    """frames in a held-out block, which starts every max(24, 2 x length) frames, or in the held-out end"""
    depth_percentiles: tuple[float, float] = (3.0, 99.8)
    """per-frame clip of the non-zero prior depth, percent"""
    depth_outliers: Literal["kept", "removed"] = "kept"
    """wrong far depth, in frames whose depth reaches much farther than in those around them: kept, or made no depth"""
    memory: NonNegative = 0.0
    """limit in GB for frames and derived data; a clip above half of it is kept in a file; 0 = half of the machine's"""


class ModelConfig(Section, frozen=True, kw_only=True):
    """Components and sizes of the model. A disabled component costs neither memory nor time."""

    appearance: bool = True
    """component A: bounded Fourier colour residual, eq. (1)-(2)"""
    spectral_motion: bool = True
    """component S: Fourier translation residual and its Matern penalty, eq. (3)-(4)"""
    laplacian: bool = True
    """component L: mask-propagating Laplacian loss, eq. (5)"""
    deformation: bool = True
    """flexible deformation model; off = a rigid scene"""
    exposure: bool = False
    """gain and bias of each colour channel for every training frame, eq. (B13)"""
    pose_correction: bool = False
    """rotation and translation on top of the given pose of every training frame, eq. (B16)"""
    basis: Literal["quartic", "gaussian"] = "quartic"
    """FDM time basis: `quartic` is what Deform3DGS and SurgicalGS compute"""
    bases: PositiveCount = 17
    """B, time bases per channel"""
    initial_width: Positive = 0.01
    """initial sigma of the time bases, normalised time"""
    harmonics_degree: Annotated[int, msgspec.Meta(ge=0, le=3)] = 3
    """highest spherical-harmonic degree"""
    frequencies: PositiveCount = 8
    """F, log-spaced frequencies"""
    frequency_min: Positive = 1.0
    """lowest frequency, cycles per sequence"""
    frequency_max: Positive = 16.0
    """highest frequency, cycles per sequence"""
    beta: Positive = 0.3
    """bound of the colour residual, display units [0, 1]"""
    correlation_length: NonNegative = 0.2
    """l of the Matern-5/2 prior, normalised time"""


class RasterConfig(Section, frozen=True, kw_only=True):
    """The rasteriser preset used in training and rendering."""

    preset: Literal["paper", "legacy", "exact"] = "paper"
    """rasteriser preset; `exact` evaluates every Gaussian at every pixel, for small scenes"""
    near: Positive = 0.2
    """near plane, scene units"""
    alpha_cutoff: Fraction | Literal["preset"] = "preset"
    """a smaller alpha contributes nothing; 0 = no cutoff"""
    transmittance_stop: Fraction | Literal["preset"] = "preset"
    """a pixel ends before its transmittance falls below this; 0 = never"""
    alpha_max: Fraction | Literal["preset"] = "preset"
    """clamp of alpha; 1 = none"""


class LossConfig(Section, frozen=True, kw_only=True):
    """Weights of the objective, eq. (6), and of the calibration, eq. (7)."""

    ssim_weight: Fraction = 0.1
    """w of (1 - w) L1 + w (1 - SSIM)"""
    depth_weight: NonNegative = 1.0
    """weight of the normalised depth loss"""
    smoothness_weight: NonNegative = 1e-4
    """weight of the smoothness terms"""
    total_variation_factor: NonNegative = 30.0
    """factor of the two total-variation terms inside the smoothness"""
    smoothness_from: Count = 1001
    """first iteration with smoothness"""
    lambda_msp: NonNegative = 1.0
    """weight of the Matern spectral penalty"""
    lambda_lap: NonNegative | Literal["auto"] = 0.83
    """full Laplacian weight; `auto` = calibrate on this sequence by eq. (7)"""
    laplacian_from: Count = 1000
    """last iteration with Laplacian weight 0"""
    laplacian_full: Count = 2500
    """first iteration with full Laplacian weight"""
    upsampling: Literal["co_sited", "half_pixel"] = "co_sited"
    """up-sampling rule of the pyramid"""
    gradient_ratio: Positive = 0.25
    """r of the calibration"""
    calibration_views: PositiveCount = 16
    """training views used by the calibration"""


class LossTerms(TypedDict, total=False):
    """The terms of eq. (6) in the log, unweighted; a term that is not evaluated is missing."""

    l1: float
    ssim: float
    depth: float
    smoothness: float
    matern_penalty: float
    laplacian: float


class OptimiserConfig(Section, frozen=True, kw_only=True):
    """Adam and its learning rates. Decaying rates fall exponentially to `final_factor` x their initial value."""

    position: NonNegative = 1.6e-3
    """canonical position, scene units per step, decaying"""
    deformation: NonNegative = 1.6e-3
    """all FDM coefficients, decaying"""
    deformation_position_factor: Positive = 1.0
    """extra factor on the FDM weights of the three position channels"""
    harmonics_base: NonNegative = 2.5e-3
    """degree-0 harmonic coefficient"""
    harmonics_rest: NonNegative = 1.25e-4
    """harmonics of degree 1 to 3"""
    opacity: NonNegative = 0.05
    """opacity logit"""
    scale: NonNegative = 0.005
    """log-scale"""
    rotation: NonNegative = 0.001
    """quaternion"""
    exposure: NonNegative = 1e-3
    """log gain and bias of the exposures, decaying"""
    pose: NonNegative = 1e-3
    """corrections of poses, decaying: rotation in rad, translation in median depths of the tissue"""
    spectral_motion_factor: NonNegative = 0.1
    """translation residual C, times `deformation`, decaying"""
    appearance_factor: NonNegative = 31.25 / 16.0
    """colour residual A, times `deformation`, decaying"""
    final_factor: Positive = 0.01
    """final / initial rate of the decaying groups"""
    annealed_factor: Annotated[float, msgspec.Meta(gt=0, le=1)] = 1.0
    """final / initial rate of opacity, scale, rotation and harmonics, which are constant before; 1 = not annealed"""
    annealing_from: Count = 4500
    """last iteration with the constant rates"""
    restart_residual_schedule: bool = True
    """residual rates decay over the steps after activation"""
    beta1: DecayRate = 0.9
    """Adam first-moment decay"""
    beta2: DecayRate = 0.999
    """Adam second-moment decay"""
    epsilon: Annotated[float, msgspec.Meta(ge=1e-37)] = 1e-15  # of few digits in float32 below 1.2e-38
    """Adam epsilon"""
    legacy_skip: bool = False
    """skip the Adam step on densify iterations, as Deform3DGS and SurgicalGS do"""


class DensityConfig(Section, frozen=True, kw_only=True):
    """Clone, split and prune."""

    start: Count = 500
    """densify at iterations > start"""
    interval: PositiveCount = 100
    """iterations between two densifications"""
    until: Count = 4000
    """densify at iterations < until; 0 = none"""
    growth: Literal["threshold", "budget"] = "threshold"
    """candidates: all from `gradient_threshold` on, or those with the largest gradients, up to `maximum` at the end"""
    gradient_threshold: Positive = 2e-4
    """smallest mean screen gradient of a cloned or split Gaussian, NDC units; not used with a budget"""
    extent: Positive | Literal["cameras"] = 10.0
    """scene extent, scene units; `cameras` = 1.1 x the largest camera distance from their mean"""
    dense_fraction: Positive = 0.01
    """clone up to, split above this fraction of the extent"""
    prune_opacity: Fraction = 0.005
    """remove Gaussians with a lower opacity"""
    maximum: PositiveCount = 400_000
    """no Gaussian is added beyond this number; a budget grows to it if enough Gaussians have a gradient"""


class InitialisationConfig(Section, frozen=True, kw_only=True):
    """Back-projected training pixels."""

    first_frame_points: PositiveCount = 35_000
    """number of pixels drawn from the first training frame"""
    other_frame_points: Count = 5_000
    """number of pixels drawn from the other training frames together"""
    motion_threshold: Positive = 40.0
    """a pixel of another frame counts as moved if its depth differs by more than this, scene units"""
    motion: Literal["none", "flow"] = "none"
    """initial motion: none, or coefficients of S fitted to the tracks of the points along optical flow"""


class TrainingConfig(Section, frozen=True, kw_only=True):
    """Length, seed and bookkeeping of a run."""

    iterations: PositiveCount = 6000
    """number of iterations, one view each; the milestones refer to it"""
    visits_per_frame: Count = 0
    """minimum iterations per training frame, up to 64 frames; lengthens the run beyond `iterations`; 0 = no minimum"""
    residual_activation: Count = 3000
    """K_s: last iteration without the residuals of A and S"""
    harmonics_interval: PositiveCount = 500
    """iterations between raises of the active harmonic degree"""
    coarse_start: bool = False
    """start on half-size frames, until the fit error is below the detail that they lack"""
    bridge_fraction: Fraction = 0.0
    """fraction of iterations at a time between two training frames, with a target made from both by optical flow"""
    seed: Count = 0
    """seed of every random draw"""
    threads: Count = 0
    """threads; 0 = all cores (results are bitwise equal for any number)"""
    precision: Literal["float32", "float64"] = "float32"
    """floating-point precision of the run"""
    checkpoint_every: PositiveCount = 1000
    """largest number of iterations between checkpoints; elapsed time may trigger them earlier"""


Preset = Literal["paper", "sharp", "quick", "demo"]


class Config(Section, frozen=True, kw_only=True):
    """All settings of a run."""

    preset: Preset = "paper"
    """preset whose values these settings start from"""
    sequence: SequenceConfig = SequenceConfig()
    model: ModelConfig = ModelConfig()
    raster: RasterConfig = RasterConfig()
    loss: LossConfig = LossConfig()
    optimiser: OptimiserConfig = OptimiserConfig()
    density: DensityConfig = DensityConfig()
    initialisation: InitialisationConfig = InitialisationConfig()
    training: TrainingConfig = TrainingConfig()

    def refuse_contradictions(self, where: str) -> None:
        """Raise InputError for settings that are allowed individually but not in combination."""
        model, loss, (low, high) = self.model, self.loss, self.sequence.depth_percentiles
        if model.frequency_max < model.frequency_min or (
            model.frequencies > 1 and model.frequency_max == model.frequency_min
        ):
            raise InputError(
                f"{where}: model.frequency_max = {model.frequency_max:g} is not allowed; "
                f"use a number > model.frequency_min = {model.frequency_min:g}"
            )
        if loss.laplacian_full < loss.laplacian_from:
            raise InputError(
                f"{where}: loss.laplacian_full = {loss.laplacian_full} is not allowed; "
                f"use an integer >= loss.laplacian_from = {loss.laplacian_from}"
            )
        self._refuse_empty(where)
        if not enclose_median(low, high):
            raise InputError(f"{where}: sequence.depth_percentiles = {[low, high]} is not allowed; use {PERCENTILES}")
        if self.training.seed > LARGEST_SEED:
            raise InputError(
                f"{where}: training.seed = {self.training.seed} is not allowed; use an integer from 0 to {LARGEST_SEED}"
            )

    def _refuse_empty(self, where: str) -> None:
        """Raise InputError for a pair of settings whose order leaves nothing between them."""
        density, (cutoff, largest) = self.density, (self.raster.alpha_cutoff, self.raster.alpha_max)
        if NO_DENSIFICATION < density.until < density.start:
            raise InputError(
                f"{where}: density.until = {density.until} is not allowed; use an integer >= density.start ="
                f" {density.start}, or 0, with which no iteration densifies"
            )
        if isinstance(cutoff, float) and isinstance(largest, float) and largest < cutoff:
            raise InputError(
                f"{where}: raster.alpha_max = {largest:g} is not allowed; use a number >= raster.alpha_cutoff ="
                f" {cutoff:g}, or nothing is drawn"
            )


PAPER = Config()


def with_settings(settings: SectionType, **changes: Any) -> SectionType:
    """A copy with changed values; a dictionary changes a section: `with_settings(config, training={"seed": 3})`."""
    return msgspec.structs.replace(
        settings,
        **{
            name: with_settings(getattr(settings, name), **value) if isinstance(value, dict) else value
            for name, value in changes.items()
        },
    )


# Keys of earlier versions, and the values equivalent to their absence.
FORMER = {
    "initialisation": {"motion_flow": ("dis",)},
    "training": {"time_jitter": (0,), "bridge_target": ("flow",), "bridge_flow": ("dis",)},
}

FRAMES_OF_FULL_VISITS = 64  # above this number of training frames, the length of a run grows with its square root

# Milestones of the schedule, by section; they scale with the length of the run.
MILESTONES = {
    "loss": ("smoothness_from", "laplacian_from", "laplacian_full"),
    "density": ("start", "until"),
    "optimiser": ("annealing_from",),
    "training": ("residual_activation", "harmonics_interval"),
}


def with_iterations(config: Config, iterations: int) -> Config:
    """The same schedule over exactly `iterations`: every milestone of `MILESTONES` keeps its fraction of the run.

    Milestones are rounded, and at least 1: one of 0, such as `residual_activation`, becomes 1. Without densification
    (`density.until` 0 or 1), there is none at any length. The length is then fixed: `visits_per_frame` is 0.
    """
    ratio = iterations / config.training.iterations
    changes = {
        section: {name: max(1, round(getattr(getattr(config, section), name) * ratio)) for name in names}
        for section, names in MILESTONES.items()
    }
    changes["training"] |= {"iterations": iterations, "visits_per_frame": 0}
    if config.density.until <= NO_DENSIFICATION:
        changes["density"]["until"] = config.density.until
    return with_settings(config, **changes)


def with_fixed_length(config: Config) -> Config:
    """The same settings with exactly `training.iterations`, for any number of frames."""
    return with_settings(config, training={"visits_per_frame": 0})


def lengthened(config: Config, training_frames: int) -> Config:
    """The settings of a run on n = `training_frames` frames, of length max(iterations, visits_per_frame x m).

    m is n up to 64 and sqrt(64 n), rounded, above: in longer clips, neighbouring frames share more tissue. The schedule
    is scaled to this length, which is then fixed: a second call changes nothing.
    """
    counted = min(training_frames, round(math.sqrt(FRAMES_OF_FULL_VISITS * training_frames)))
    wanted = config.training.visits_per_frame * counted
    return with_iterations(config, wanted) if wanted > config.training.iterations else with_fixed_length(config)


_FOLLOWING = Config(  # common to `sharp`, `quick` and `demo`: Gaussians that follow the tissue from the start
    preset="sharp",
    sequence=SequenceConfig(depth_outliers="removed"),
    model=ModelConfig(initial_width=0.05),
    loss=LossConfig(ssim_weight=0.7, lambda_lap=1.2),
    optimiser=OptimiserConfig(deformation_position_factor=3.0, annealed_factor=0.05),
    density=DensityConfig(maximum=80_000),
    initialisation=InitialisationConfig(motion="flow"),
    training=TrainingConfig(bridge_fraction=0.7),
)
SHARP = with_settings(
    with_iterations(_FOLLOWING, 3000),
    # 1.5 to 3 times those of `paper`: docs/specification/rulings.md, "Presets of a run"
    optimiser={"position": 3.2e-3, "deformation": 2.4e-3, "harmonics_base": 5e-3, "scale": 0.01, "rotation": 0.003},
    training={"visits_per_frame": 72},
)
QUICK = with_settings(
    with_iterations(SHARP, 1600),
    preset="quick",
    # affordable for a first look at 640x512 pixels
    density={"growth": "budget", "maximum": 22_000},
    initialisation={"first_frame_points": 14_000, "other_frame_points": 2_000},
    training={"coarse_start": True, "visits_per_frame": 29},  # 1600 iterations up to 55 training frames
)
DEMO = with_settings(
    with_iterations(_FOLLOWING, 1500),
    preset="demo",
    # points and threshold suit its 160x128 pixels
    density={"gradient_threshold": 7e-4},
    initialisation={"first_frame_points": 6000, "other_frame_points": 1500},
)
PRESETS = {"paper": PAPER, "sharp": SHARP, "quick": QUICK, "demo": DEMO}


def config_from_dict(data: Keys, where: str = "configuration") -> Config:
    """A strict `Config` from nested dictionaries over the preset named in data["preset"] (default `paper`)."""
    preset = data.get("preset", "paper")
    if not isinstance(preset, str) or preset not in PRESETS:
        raise InputError(f"{where}: preset = {preset!r} is not allowed; use {choice(PRESETS)}")
    data = without_former_keys(data, where, PRESETS[preset].training.bridge_fraction)
    refuse_unknown_keys(data, Config, where)
    return checked(merged(msgspec.to_builtins(PRESETS[preset]), data), Config, where)


def load_config(path: Path) -> Config:
    """Read a TOML file. Raises InputError with file, key and allowed values."""
    return config_from_dict(read_toml(path), str(path))


def merged(base: Keys, changes: Keys) -> Keys:
    """Settings as plain data, with the changes of one source (such as a file) merged over the earlier sources.

    A source with `iterations` but without `visits_per_frame` fixes the length of the run and overrides earlier
    `visits_per_frame`.
    """
    if "iterations" in changes and "visits_per_frame" in base:
        changes = {"visits_per_frame": 0} | changes
    return base | {
        key: merged(base[key], value) if isinstance(value, dict) and isinstance(base.get(key), dict) else value
        for key, value in changes.items()
    }


def without_former_keys(data: Keys, where: str, bridge_fraction: float = 0.0) -> Keys:
    """The settings without the keys of `FORMER`, which stored runs of earlier versions have.

    bridge_fraction   default if the data has none: without bridged times, their target is irrelevant

    A stored run of an earlier version has both its length and the visits of its preset; the length is used.
    Raises:  InputError for a former key with another value.
    """
    out, found = dict(data), 0
    for section, keys in FORMER.items():
        values = data.get(section)
        if not isinstance(values, dict):
            continue
        out[section] = {key: value for key, value in values.items() if key not in keys}
        for key, allowed in ((key, allowed) for key, allowed in keys.items() if key in values):
            unused = key == "bridge_target" and values.get("bridge_fraction", bridge_fraction) == 0
            if values[key] not in allowed and not (unused and values[key] == "neighbour"):
                raise InputError(
                    f"{where}: {section}.{key} = {values[key]!r} is not allowed: the key left with an earlier version; "
                    f"use {allowed[0]!r}, or no such key (runs with other values open only in that version)"
                )
            found += 1
    if found == sum(map(len, FORMER.values())) and "iterations" in data["training"]:
        out["training"] = out["training"] | {"visits_per_frame": 0}
    return out


def config_to_toml(config: Config) -> str:
    """The resolved configuration as TOML text; `load_config` restores an equal Config."""
    return toml_text(msgspec.to_builtins(config))
