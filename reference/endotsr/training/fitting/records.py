"""Records of a training: log entries, checkpoint headers, and the work on targets."""

from typing import NamedTuple, Required, TypedDict

from endotsr.config import LossTerms
from endotsr.untrusted.json import Keys

TERMS = tuple(LossTerms.__annotations__)


class LogEntry(LossTerms, total=False):
    """One line of log.jsonl."""

    iteration: Required[int]  # from 1
    frame: Required[int]
    loss: Required[float]
    psnr: float | None  # dB, over the tissue of the view; None for a perfect render or without tissue
    gaussians: Required[int]
    seconds: float


class Making(NamedTuple):
    """The work on targets between the frames up to now, for forecasts; no result depends on it."""

    gaps: int = 0  # computed
    waited: float = 0.0  # seconds that the training waited for them
    beside: float = 0.0  # seconds of processor time in the second thread


NOTHING_MADE = Making()


class RngState(TypedDict):
    """The state of a PCG64 generator, in NumPy's format."""

    bit_generator: str
    state: dict[str, int]
    has_uint32: int
    uinteger: int


class CheckpointHeader(TypedDict, total=False):
    """Entries of a checkpoint besides arrays and counters; earlier versions have fewer."""

    config: Keys  # the settings, by section
    lambda_lap: float | None
    sequence: str | None  # fingerprint of the sequence
    coarse: bool
    diverged: Keys  # iteration, frame and term, in the dump of a diverged iteration


class Description(TypedDict):
    """The JSON header of the file."""

    format: str
    version: int
    iteration: int
    rng_state: RngState
    steps: dict[str, int]  # Adam steps, by array
    header: CheckpointHeader
    arrays: dict[str, list]  # dtype, shape and SHA-256 (None if unknown), by entry
