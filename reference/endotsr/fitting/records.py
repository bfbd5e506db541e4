"""What a training writes: the entry of an iteration in its log, and the header of its checkpoints."""

from typing import Any, Required, TypedDict


class LogEntry(TypedDict, total=False):
    """One line of log.jsonl; the loss terms are unweighted, and one that took no part is missing."""

    iteration: Required[int]  # from 1
    frame: Required[int]
    loss: Required[float]
    l1: float
    ssim: float
    depth: float
    smoothness: float
    matern_penalty: float
    laplacian: float
    psnr: float | None  # dB, over the tissue of the view; None for a perfect render or without tissue
    gaussians: Required[int]
    seconds: float


class RngState(TypedDict):
    """The state of a PCG64 generator, as NumPy gives and takes it."""

    bit_generator: str
    state: dict[str, int]
    has_uint32: int
    uinteger: int


class CheckpointHeader(TypedDict, total=False):
    """What a checkpoint holds beside its arrays and counters; earlier versions hold less."""

    config: dict[str, Any]  # the settings, by section
    lambda_lap: float | None
    sequence: str | None  # fingerprint of the sequence
    coarse: bool
    diverged: dict[str, Any]  # iteration, frame and term, in the dump of an iteration that was not finite


class Description(TypedDict):
    """The JSON header of the file."""

    format: str
    version: int
    iteration: int
    rng_state: RngState
    steps: dict[str, int]  # Adam steps, by array
    header: CheckpointHeader
    arrays: dict[str, list]  # dtype, shape and SHA-256, by entry; None for a digest that is not known
