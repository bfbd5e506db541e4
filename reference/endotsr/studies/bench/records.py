"""What the benchmark of the stages writes: the parts of its JSON."""

from typing import Any, TypedDict


class Spread(TypedDict):
    """Median and quartiles (25 %, 75 %) of repeated times, milliseconds."""

    median_ms: float
    quartiles_ms: list[float]


class Densification(Spread):
    """The densification within an iteration, and its time divided by its interval."""

    per_iteration_ms: float
    gaussians: int


class ViewCounts(TypedDict):
    """Gaussians that are visible, entries of the lists of the tiles, and blended pairs of Gaussian and pixel."""

    visible: int
    listed: int
    blended: int


class Limit(TypedDict):
    """The lower bound of a stage."""

    limit_ms: float
    bound: str  # arithmetic or memory
    fraction: float | None  # limit / measured median


class Peaks(TypedDict):
    """The best rates of the machine."""

    threads: int
    flop_per_second: dict[str, float]  # by precision
    bytes_per_second: dict[str, float]  # by kernel


class CaseTimes(TypedDict):
    """The times of one case, without its limits."""

    case: Any  # the fields of BenchCase
    stages: dict[str, Spread]
    splat: Spread  # the sum of the four splatting stages
    iteration: Spread  # the sum of all stages
    first_iteration_s: float  # with compilation or loading of compiled code
    view: ViewCounts
    parameters: int  # per Gaussian
    peak_memory_bytes: int | None
    densification: Densification | None  # None if none was timed


class CaseResult(CaseTimes):
    """The measurement of one case."""

    limits: dict[str, Limit]  # by stage
    ns_per_pair: dict[str, float | None]  # of both blends and of all splatting stages


class BenchResult(TypedDict):
    """All cases, and the peaks per number of threads."""

    peaks: list[Peaks]
    cases: list[CaseResult]
