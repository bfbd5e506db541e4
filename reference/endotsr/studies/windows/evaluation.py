"""What an evaluation of a windowed run adds to metrics.json."""

from typing import TypedDict

from endotsr.results.evaluation.records import EvaluationRecord


class WindowCost(TypedDict):
    """The training of a window."""

    start: str  # warm or cold
    iterations: int
    saved: int  # iterations that a warm start saved
    seconds: float
    peak_memory_bytes: int | None


class WindowRow(WindowCost):
    """A window: its frames, the cost, and the mean held-out PSNR of the tissue, dB."""

    name: str
    first: int
    end: int
    psnr_tissue: float | None  # None: no frame of it is held out


class Flicker(TypedDict):
    """Flicker at seams and inside of windows, grey levels; None where there is no frame."""

    seams: float | None
    inside: float | None
    ratio: float | None


class Seams(TypedDict):
    """Flicker of the model and of the recording, and the numbers of frames."""

    seam_frames: int
    inside_frames: int
    model: Flicker
    recorded: Flicker


class LeftOutRow(TypedDict):
    """Frames that no window trains on."""

    first: int
    end: int
    reason: str


class WindowedEvaluation(EvaluationRecord):
    """metrics.json of a windowed run; without a held-out frame it has these keys and `format` alone."""

    windows: list[WindowRow]
    left_out: list[LeftOutRow]
    seams: Seams
    arrays_sha256: dict[str, str]  # of `images` and `masks` of the covered frames, each frame once
