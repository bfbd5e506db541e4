"""The types of metrics.json. Every number is finite; a metric without a value is None."""

from typing import NotRequired, Required, TypedDict

from endotsr.results.evaluation.coverage import FrameCoverage
from endotsr.training.runs.machine import MachinePart
from endotsr.training.runs.records import InputPart
from endotsr.untrusted.json import Keys

Means = dict[str, float | None]  # metric -> value


class MetricValues(TypedDict, total=False):
    """Every metric; PSNR in dB."""

    psnr_full: float | None
    psnr_tissue: float | None
    psnr_seen: float | None  # over tissue pixels that a training frame shows
    psnr_seen_twice: float | None  # over tissue pixels that two or more training frames show
    psnr_full_8bit: float | None
    psnr_tissue_8bit: float | None
    ssim_full_8bit: float | None
    ssim_tissue_8bit: float | None
    ssim_full: float | None
    ssim_tissue: float | None
    lpips: float | None
    lpips_symmetric: float | None


class LabelledMeans(MetricValues, total=False):
    """Metrics with a label."""

    label: Required[str]


class FrameMetrics(MetricValues, total=False):
    """Number, name, time and metrics of one frame."""

    frame: Required[int]
    name: Required[str]
    time: Required[float]


class FramesMeasured(TypedDict):
    """Metrics of several frames."""

    mean: Means  # over the frames with a value
    per_frame: list[FrameMetrics]
    excluded: dict[str, int]  # metric -> number of frames without a value, if any
    not_finite: int  # number of values that are not finite, of frames with tissue


class LabelledFrames(FramesMeasured):
    """Metrics of several frames with a label: of a baseline, or of the blend of renders."""

    label: str


class FramesPart(TypedDict):
    """The entry `frames` of metrics.json."""

    total: int
    training: int
    held_out: list[int]
    training_sample: list[int]
    tissue_fraction: float
    extrapolated: NotRequired[list[int]]  # of `held_out`: before the first or after the last training frame
    coverage: NotRequired[list[FrameCoverage] | None]  # of `held_out`; None if the camera moves


class MotionPart(TypedDict):
    """The entry `trajectories` of metrics.json: error of the motion, and size of the true motion."""

    scene_units: float
    pixels: float
    motion_scene_units: float
    motion_pixels: float
    unit: str


class PosePart(TypedDict):
    """The entry `pose_correction` of metrics.json: means over the training cameras."""

    degrees: float
    scene_units: float
    pixels: float
    unit: str


class RunPart(TypedDict):
    """The entry `run` of metrics.json: checkpoint, settings, input and machine."""

    iteration: int
    iterations_planned: int
    status: str | None
    gaussians: int
    seed: int | None
    threads: int | None
    started: str | None
    finished: str | None
    seconds: float | None
    peak_memory_bytes: int | None
    lambda_lap: float | None
    versions: dict[str, str]
    machine: MachinePart
    input: InputPart
    settings: Keys


class PicturesPart(TypedDict):
    """The entry `pictures` of metrics.json: the evaluated folder or video."""

    folder: str
    pairing: str
    doubt: str  # a sentence on pictures that look like a mistake; empty without one
    arrays_sha256: dict[str, str]
    files: dict[str, str]  # file of every frame


MeasureRow = dict[str, str | float | None]
"""A row of a measurement: its `label`, and values by name; None where there is no frame."""


class Measured(TypedDict, total=False):
    """One entry of `measures` in metrics.json: `rows`, or the `reason` why there are none."""

    reason: str
    rows: list[MeasureRow]
    unit: str  # of lengths
    pixels: int  # of `flicker`: static pixels
    left_out: list[str]  # of `flicker`: names of the frames without tissue, if any
    baseline: float  # of `right_view`: distance of both cameras
    spread: float  # of `right_view`: relative spread of the baseline


class EvaluationRecord(TypedDict):
    """metrics.json of a model, or of pictures (with `label`)."""

    format: int
    frames: FramesPart
    held_out: FramesMeasured
    training: FramesMeasured
    temporal_gap: NotRequired[Means]
    components: NotRequired[list[LabelledMeans]]  # with one residual left out
    baselines: dict[str, LabelledFrames]
    lpips_reason: str | None  # None if LPIPS was computed
    not_finite: int
    recorded_texture: NotRequired[LabelledFrames]
    cross_fade: NotRequired[LabelledFrames]
    trajectories: NotRequired[MotionPart | None]
    pose_correction: NotRequired[PosePart | None]
    measures: NotRequired[dict[str, Measured]]
    label: NotRequired[str]


class PicturesEvaluation(EvaluationRecord):
    """The metrics of a folder of pictures or a video."""

    pictures: PicturesPart


class RunEvaluation(EvaluationRecord):
    """metrics.json of a run."""

    run: RunPart
