"""Checks of the prior depth: unit, scale, constancy, quantisation, coverage, and renderings of depth instead of depth.

In: one `DepthFacts` per frame. Out: findings. Plausible lengths are those of endoscopy: tissue at 5 to 500 mm.
"""

from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.depth_rims import blended_rim
from endotsr.clips.sequences.checks.depth_wraps import WRAPPED, wrapped_part
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.depth_files import CLIPPED
from endotsr.clips.sequences.depth_outliers import outlying_frames, said
from endotsr.errors import InputError

NEAREST, FARTHEST = 5.0, 500.0  # mm; a median outside indicates another unit
FEW_LEVELS = 6  # whole millimetres, as in published clips, give a dozen or more
LITTLE = 0.2  # of the tissue
FAR_OFF = 4.0
LEAST_FRAMES, REPEATED = 4, 0.5  # frames; different planes of depth for each of them
FULL_SCALE = (255.0, 65535.0)
MARK, MARKED = 8.0, 0.005  # a mark of missing depth: times the median, fraction of the pixels
APART, ENDS = 1.5, (0.5, 99.5)  # the same in all frames: times these percentiles of the other depths
BLENDED = 0.3  # of the pixels beside holes; at most 0.01 on measured clips, 1 where holes were interpolated
AGAINST_LIGHT = 0.4  # rank correlation of brightness with depth; measured clips have -0.55 to -0.84
LIT, FEWEST = (20, 250), 300  # grey levels that are neither black nor overexposed; pixels of a correlation


class DepthFacts(NamedTuple):
    """Facts on the depth of a frame."""

    name: str
    median: float  # 0 without any
    lowest: float
    highest: float
    levels: int  # distinct values; of many, among every eighth value
    tissue_coverage: float  # fraction of the tissue that has depth
    stored_highest: float  # largest stored value
    integers: bool  # the file stores integers
    at_highest: float = 0.0  # fraction of the pixels with depth that have the largest value
    limit: float = 0.0  # far limit: the upper percentile to which a reader clips
    digest: bytes = b""  # of the depth, equal for equal planes
    at_lowest: float = 0.0  # as at_highest
    blended: float = 0.0  # see `depth_rims.blended_rim`
    wrapped: float = 0.0  # see `depth_wraps.wrapped_part`
    others: tuple[float, float] = (0.0, 0.0)  # between which all depths but the lowest and highest lie, outliers aside


def depth_facts(name: str, depth: NDArray[np.float32], stored: NDArray, tissue: NDArray[np.bool_] | None) -> DepthFacts:
    """The facts on a frame; `stored` are the values of the file, `tissue` is the mask or None."""
    known = depth > 0
    values = depth[known]
    inside = known if tissue is None or tissue.shape != depth.shape else known[tissue]
    return DepthFacts(
        name,
        float(np.median(values)) if values.size else 0.0,
        float(values.min()) if values.size else 0.0,
        float(values.max()) if values.size else 0.0,
        _levels(values),
        float(inside.mean()) if inside.size else 1.0,
        float(np.nanmax(stored)) if stored.size else 0.0,
        stored.dtype.kind in "iu",
        float((values == values.max()).mean()) if values.size else 0.0,
        float(np.percentile(values, CLIPPED[1])) if values.size else 0.0,
        blake2b(depth.tobytes(), digest_size=16).digest(),
        float((values == values.min()).mean()) if values.size else 0.0,
        blended_rim(depth),
        wrapped_part(stored),
        _between(values),
    )


def _between(values: NDArray[np.float32]) -> tuple[float, float]:
    """Between which depths all but the lowest and the highest one lie, outliers aside; (0, 0) without others."""
    inner = values[::4]
    inner = inner[(inner > values.min()) & (inner < values.max())] if values.size else inner
    low, high = np.percentile(inner, ENDS) if inner.size else (0.0, 0.0)
    return float(low), float(high)


def _levels(values: NDArray[np.float32]) -> int:
    """The number of distinct values, exact if it is small."""
    some = len(np.unique(values[::8]))
    return some if some >= FEW_LEVELS else len(np.unique(values))


def depth_findings(
    facts: list[DepthFacts], where: str, arbitrary: bool, near: float, assumed: str = ""
) -> list[Finding]:
    """Findings on the depth of a sequence. `assumed`: unmeasured properties as stated in sequence.toml."""
    with_depth = [fact for fact in facts if fact.median > 0]
    if not with_depth:
        return [finding("no-depth", where, "no pixel of any frame has depth")]
    usual = usual_depth(facts)
    found = _numbers(with_depth, where)
    if assumed:
        found = [finding("assumed-depth", where, f"not measured of the depth: its {assumed}")]
    if not arbitrary and not found:
        found += unit_finding(usual, where)
    if usual <= near:
        found.append(finding("near-plane", where, f"median depth {usual:.4g} is before the near plane"))
    found += [kind for i, fact in enumerate(facts) for kind in _of_frame(fact, usual, where, i)]
    if outlying := outlying_frames(far_limits(facts)):
        found.append(finding("depth-outliers", where, f"the depth reaches much farther in frame {said(outlying)}"))
    found += [] if assumed else _repeated(with_depth, where)
    found += rim_finding([fact.blended for fact in with_depth], where)
    coverage = float(np.mean([fact.tissue_coverage for fact in facts]))
    if coverage < LITTLE:
        found.append(finding("little-depth", where, f"{coverage:.1%} of the tissue has depth"))
    return found


def rim_finding(blended: list[float], where: str) -> list[Finding]:
    """A warning on depth that was interpolated across holes; `blended` of the frames, NaN where unknown."""
    known = [value for value in blended if np.isfinite(value)]
    if not known or np.median(known) < BLENDED:
        return []
    what = f"{np.median(known):.0%} of the pixels beside a pixel without depth are far nearer than those around them"
    return [finding("blended-depth", where, what)]


def _repeated(facts: list[DepthFacts], where: str) -> list[Finding]:
    """A note on depth that is stored once for many frames."""
    different = len({fact.digest for fact in facts})
    if len(facts) < LEAST_FRAMES or different > REPEATED * len(facts):
        return []
    return [finding("still-depth", where, f"the depth of {len(facts)} frames is that of {different}")]


def usual_depth(facts: list[DepthFacts]) -> float:
    """The median over the frames with depth of their median depth; 0 without depth."""
    return float(np.median([fact.median for fact in facts if fact.median] or [0.0]))


def far_limits(facts: list[DepthFacts]) -> NDArray[np.float64]:
    """The far limit (n,) of the depth of every frame; 0 without depth."""
    return np.array([fact.limit for fact in facts], np.float64)


def _of_frame(fact: DepthFacts, usual: float, where: str, i: int) -> list[Finding]:
    """A frame without depth, or with depth at another scale; `usual` is the median over the frames."""
    if fact.median == 0:
        return [finding("frame-without-depth", where, f"{fact.name} has no depth", i)]
    ratio = fact.median / usual
    if not 1 / FAR_OFF <= ratio <= FAR_OFF:
        return [finding("depth-far-off", where, f"median of {fact.name} is {ratio:.3g} times the usual", i)]
    return []


def _numbers(facts: list[DepthFacts], where: str) -> list[Finding]:
    """Depth that is a rendering of depth, or was truncated to a few values."""
    highest = {fact.stored_highest for fact in facts}
    integers = all(fact.integers for fact in facts)
    if integers and max(highest) <= 3:
        return [finding("metres-cut", where, f"the stored numbers are at most {max(highest):g}")]
    if all(fact.lowest == fact.highest for fact in facts):
        return [finding("constant-depth", where, "every frame has one and the same depth everywhere")]
    if marked := mark_finding(facts, where):
        return marked
    if (wrapped := float(np.median([fact.wrapped for fact in facts]))) > WRAPPED:
        what = f"{wrapped:.2%} of the pixels lie beside a step between the ends of the type (limit {WRAPPED:.2%})"
        return [finding("wrapped-depth", where, what)]
    if len(facts) > 2 and len(highest) == 1 and highest & set(FULL_SCALE) and integers:
        return [finding("normalised-depth", where, f"the largest number of every frame is {max(highest):g}")]
    levels = int(np.median([fact.levels for fact in facts]))
    if levels < FEW_LEVELS:
        return [finding("coarse-depth", where, f"a frame holds {levels} different depths")]
    return []


def mark_finding(facts: list[DepthFacts], where: str) -> list[Finding]:
    """A warning if many pixels of most frames have one far too large value, such as 65535 or 1e6."""
    found = [fact for fact in facts if fact.at_highest > MARKED and fact.highest > MARK * fact.median]
    if not found or len(found) <= len(facts) / 2:
        return _apart(facts, where)
    fraction = float(np.mean([fact.at_highest for fact in found]))
    times = float(np.mean([fact.highest / fact.median for fact in found]))
    stored = f"{fraction:.1%} of the pixels hold {found[0].stored_highest:g}"
    return [finding("marked-depth", where, f"{stored}, {times:.3g} times the median depth")]


def _apart(facts: list[DepthFacts], where: str) -> list[Finding]:
    """As `mark_finding`, if one number of all frames lies apart from their other depths.

    The far plane of a renderer is such a number, and so is the least one that a network writes where it knows nothing.
    """
    known = [fact for fact in facts if fact.others != (0.0, 0.0)]
    if len(known) < LEAST_FRAMES or len(known) < len(facts):
        return []
    nearest, farthest = min(fact.others[0] for fact in known), max(fact.others[1] for fact in known)
    lowest, highest = ({getattr(fact, name) for fact in known} for name in ("lowest", "highest"))
    if len(highest) == 1 and max(highest) > APART * farthest:
        value, at, others = max(highest), [fact.at_highest for fact in known], f"most {farthest:.4g}"
    elif len(lowest) == 1 and APART * min(lowest) < nearest:
        value, at, others = min(lowest), [fact.at_lowest for fact in known], f"least {nearest:.4g}"
    else:
        return []
    if np.median(at) <= MARKED:
        return []
    what = f"{np.mean(at):.1%} of the pixels have the depth {value:.4g} in every frame, nearly all others at {others}"
    return [finding("marked-depth", where, what)]


def unit_finding(usual: float, where: str) -> list[Finding]:
    """A warning on a median depth, in millimetres, outside the range of an endoscope."""
    if NEAREST <= usual <= FARTHEST:
        return []
    guesses = ((256.0, "millimetres times 256"), (1e-3, "metres"), (0.1, "centimetres"), (1000.0, "micrometres"))
    likely = [text for factor, text in guesses if 20 <= usual / factor <= 200]
    guess = f"; it looks like {' or '.join(likely)}" if likely else ""
    return [finding("depth-unit", where, f"the median depth is {usual:.4g} mm{guess}")]


def light_correlation(
    picture: NDArray[np.uint8], depth: NDArray[np.float32], tissue: NDArray[np.bool_] | None
) -> float:
    """The rank correlation of brightness with depth over the tissue of a frame; NaN for too few pixels.

    picture (H, W, 3), depth (H, W), 0 = none; tissue (H, W) or None. Black and overexposed pixels are ignored.
    """
    from scipy.stats import rankdata

    step = max(1, min(depth.shape) // 96)
    small, values = picture[::step, ::step], depth[::step, ::step]
    brightest = small.max(axis=2)
    usable = (values > 0) & (brightest > LIT[0]) & (brightest < LIT[1])
    if tissue is not None:
        usable &= tissue[::step, ::step]
    if usable.sum() < FEWEST or np.ptp(values[usable]) == 0:
        return float("nan")
    light = small[usable].sum(axis=1, dtype=np.float64)
    if np.ptp(light) == 0:
        return float("nan")
    return float(np.corrcoef(rankdata(light), rankdata(values[usable]))[0, 1])


def light_finding(correlations: list[float], where: str) -> list[Finding]:
    """A warning if brightness increases with depth in every checked frame."""
    known = [value for value in correlations if np.isfinite(value)]
    if not known or np.median(known) < AGAINST_LIGHT or min(known) < AGAINST_LIGHT / 2:
        return []
    what = f"brightness increases with depth (rank correlation {np.median(known):.2f}; a true depth has a negative one)"
    return [finding("depth-against-light", where, what)]


def depth_note(depth: NDArray[np.float32], near: float, where: Path, unit: str) -> str:
    """The note on the prior depth (n, H, W) of a folder, in this unit. Raises InputError without depth.

    Raises it also for depth that lies before the near plane as a whole.
    """
    rows = [_extent(plane, near) for plane in depth]  # frame by frame, without an array over all frames
    known, before = sum(row.known for row in rows), sum(row.before for row in rows)
    if not known:
        raise InputError(f"{where}: no pixel of the {len(depth)} frames has a depth")
    nearest, farthest = min(row.nearest for row in rows), max(row.farthest for row in rows)
    if farthest <= near:
        raise InputError(f"{where}: the largest depth is {farthest:g}, in front of the near plane at {near:g}")
    empty = [i for i, row in enumerate(rows) if not row.known]
    behind = before / known
    return (
        f"depth in {unit}, {nearest:g} to {farthest:g} after clipping;"
        f" missing on {1 - known / depth.size:.1%} of the pixels"
        + (f"; frames without any: {', '.join(map(str, empty))}" if empty else "")
        + (f"; {behind:.1%} of it is in front of the near plane at {near:g}" if behind else "")
    )


class _Extent(NamedTuple):
    """Statistics of the prior depth of a frame."""

    known: int  # pixels with depth
    before: int  # pixels with depth up to the near plane
    nearest: np.floating
    farthest: np.floating


def _extent(plane: NDArray[np.float32], near: float) -> _Extent:
    values = plane[plane > 0]
    if not values.size:
        return _Extent(0, 0, np.float32(np.inf), np.float32(0))
    return _Extent(values.size, int(np.count_nonzero(values <= near)), values.min(), values.max())
