"""The input of a report: plain arrays, dictionaries and text."""

from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.records import EvaluationRecord, FrameMetrics
from endotsr.training.fitting.records import LogEntry

# key in metrics.json, heading, decimals, +1 if larger is better, -1 if smaller is better
COLUMNS = (
    ("psnr_full", "PSNR full, dB", 2, 1),
    ("psnr_tissue", "PSNR tissue, dB", 2, 1),
    ("psnr_full_8bit", "PSNR full, 8‑bit, dB", 2, 1),
    ("psnr_tissue_8bit", "PSNR tissue, 8‑bit, dB", 2, 1),
    ("ssim_full", "SSIM full", 4, 1),
    ("ssim_tissue", "SSIM tissue", 4, 1),
    ("lpips", "LPIPS [0,1]", 4, -1),
    ("lpips_symmetric", "LPIPS [−1,1]", 4, -1),
)
SEEN = (  # of `evaluation.coverage`, in a folded table
    ("psnr_tissue", "PSNR tissue, dB", 2, 1),
    ("psnr_seen", "Seen in training, dB", 2, 1),
    ("psnr_seen_twice", "Seen twice or more, dB", 2, 1),
)
DECIDING = tuple(column for column in COLUMNS if not column[0].endswith("_8bit"))  # the others are folded


class Preview(NamedTuple):
    """A small animation of the scene."""

    moving: bytes  # animated WebP
    still: bytes  # WebP, its first picture, for readers who prefer reduced motion
    width: int  # pixels
    height: int
    words: str  # caption, one sentence


@dataclass(frozen=True)
class FramePictures:
    """A held-out frame of the report."""

    index: int  # frame number
    name: str  # file name or other label
    time: float  # normalised, in [0, 1)
    render: FloatArray  # (3, H, W) display units [0, 1]
    truth: FloatArray  # (3, H, W) display units [0, 1]
    mask: NDArray[np.bool_]  # (H, W) True = tissue
    depth: FloatArray | None = None  # (H, W) rendered depth, scene units; <= 0 = none
    metrics: FrameMetrics | None = None  # the frame's entry of metrics.json
    seen: NDArray[np.int32] | None = None  # (H, W) training frames in which the pixel is tissue; None: camera moves


@dataclass(frozen=True)
class ReportData:
    """The content of the report. Empty parts are left out; the title is required."""

    title: str
    evaluation: EvaluationRecord = field(default_factory=lambda: cast(EvaluationRecord, {}))  # metrics.json
    log: list[LogEntry] = field(default_factory=list)  # log.jsonl
    frames: tuple[FramePictures, ...] = ()
    configuration: str = ""  # TOML
    depth_unit: str = "scene units"
    preview: Preview | None = None
    viewer: str = ""  # file name of the viewer page in the folder of the report
