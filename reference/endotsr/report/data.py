"""The input of a report: plain arrays, dictionaries and text. This module handles no file, picture or HTML."""

from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from endotsr.evaluation.records import EvaluationRecord, FrameMetrics
from endotsr.fitting.records import LogEntry
from endotsr.kernels.arrays import FloatArray

# key in metrics.json, heading, decimals, +1 if larger is better and -1 if smaller is
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
DECIDING = tuple(column for column in COLUMNS if not column[0].endswith("_8bit"))  # shown without unfolding anything


class Preview(NamedTuple):
    """A small moving picture of the scene."""

    moving: bytes  # animated WebP
    still: bytes  # WebP, its first picture, for readers who asked for no motion
    width: int  # pixels
    height: int
    words: str  # what it shows, one sentence


@dataclass(frozen=True)
class FramePictures:
    """One held-out frame to show."""

    index: int  # frame number
    name: str  # file name or other label
    time: float  # normalised, in [0, 1)
    render: FloatArray  # (3, H, W) display units [0, 1]
    truth: FloatArray  # (3, H, W) display units [0, 1]
    mask: NDArray[np.bool_]  # (H, W) True = tissue
    depth: FloatArray | None = None  # (H, W) rendered depth, scene units; <= 0 = none
    metrics: FrameMetrics | None = None  # the frame's entry of metrics.json


@dataclass(frozen=True)
class ReportData:
    """The contents of the page. Every part but the title may be empty and is then left out."""

    title: str
    evaluation: EvaluationRecord = field(default_factory=lambda: cast(EvaluationRecord, {}))  # metrics.json
    log: list[LogEntry] = field(default_factory=list)  # log.jsonl
    frames: tuple[FramePictures, ...] = ()
    configuration: str = ""  # TOML
    depth_unit: str = "scene units"
    preview: Preview | None = None
    viewer: str = ""  # file name of the viewer page beside the report
