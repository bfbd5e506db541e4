"""Checks of the prior depth: unit, scale, constancy, quantisation, coverage, and pictures of depth instead of depth.

Comes in: one `DepthFacts` a frame; goes out: findings. Lengths are judged as those of endoscopy: tissue lies between 5
and 500 mm.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.sequences.checks.findings import Finding

NEAREST, FARTHEST = 5.0, 500.0  # mm; medians outside are another unit
FEW_LEVELS = 6  # whole millimetres, as published clips have them, give a dozen and more
LITTLE = 0.2  # of the tissue
FAR_OFF = 4.0
FULL_SCALE = (255.0, 65535.0)


class DepthFacts(NamedTuple):
    """What is kept of the depth of a frame."""

    name: str
    median: float  # 0 without any
    lowest: float
    highest: float
    levels: int  # different values; of many, those among every eighth
    tissue_coverage: float  # fraction of the tissue that has depth
    stored_highest: float  # largest stored number
    integers: bool  # the file holds whole numbers


def depth_facts(name: str, depth: NDArray[np.float32], stored: NDArray, tissue: NDArray[np.bool_] | None) -> DepthFacts:
    """The facts of a frame; `stored` are the numbers of the file, `tissue` its mask or None."""
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
    )


def _levels(values: NDArray[np.float32]) -> int:
    """The number of different values: exact where it is small, which alone matters."""
    some = len(np.unique(values[::8]))
    return some if some >= FEW_LEVELS else len(np.unique(values))


def depth_findings(facts: list[DepthFacts], where: str, arbitrary: bool, near: float) -> list[Finding]:
    """Findings on the depth of a sequence."""
    with_depth = [fact for fact in facts if fact.median > 0]
    if not with_depth:
        return [
            Finding(
                "refusal",
                "no-depth",
                where,
                None,
                "no pixel of any frame has depth",
                "nothing can be placed in space",
                "make depth with `endotsr depth`, or check its scale",
            )
        ]
    found = []
    usual = float(np.median([fact.median for fact in with_depth]))
    found += _whole(with_depth, where)
    if not arbitrary and not found:
        found += _unit(usual, where)
    if usual <= near:
        found.append(
            Finding(
                "warning",
                "near-plane",
                where,
                None,
                f"median depth {usual:.4g} is before the near plane",
                "what lies before the near plane is not drawn",
                "check the unit of the depth",
            )
        )
    for i, fact in enumerate(facts):
        if fact.median == 0:
            found.append(
                Finding(
                    "note",
                    "frame-without-depth",
                    where,
                    i,
                    f"{fact.name} has no depth",
                    "it takes no part in the initialisation",
                    "none needed if these are few",
                )
            )
        elif not 1 / FAR_OFF <= fact.median / usual <= FAR_OFF:
            ratio = fact.median / usual
            found.append(
                Finding(
                    "warning",
                    "depth-far-off",
                    where,
                    i,
                    f"median of {fact.name} is {ratio:.3g} times the usual",
                    "the depth of this frame may be in another unit or normalised",
                    "write all frames with one scale",
                )
            )
    coverage = float(np.mean([fact.tissue_coverage for fact in facts]))
    if coverage < LITTLE:
        found.append(
            Finding(
                "warning",
                "little-depth",
                where,
                None,
                f"{coverage:.1%} of the tissue has depth",
                "the scene is initialised there only",
                "another stereo method, or wider ranges",
            )
        )
    return found


def _whole(facts: list[DepthFacts], where: str) -> list[Finding]:
    """Depth that is a picture of depth, or was cut to a few numbers."""
    highest = {fact.stored_highest for fact in facts}
    if all(fact.integers for fact in facts) and max(highest) <= 3:
        return [
            Finding(
                "refusal",
                "metres-cut",
                where,
                None,
                f"the stored numbers are at most {max(highest):g}",
                "metres were cut to whole numbers",
                "store millimetres, or a smaller step with its scale",
            )
        ]
    if all(fact.lowest == fact.highest for fact in facts):
        return [
            Finding(
                "refusal",
                "constant-depth",
                where,
                None,
                "every frame has one and the same depth everywhere",
                "the scene would be a flat board",
                "supply measured depth",
            )
        ]
    if len(facts) > 2 and len(highest) == 1 and highest & set(FULL_SCALE) and all(fact.integers for fact in facts):
        return [
            Finding(
                "warning",
                "normalised-depth",
                where,
                None,
                f"the largest number of every frame is {max(highest):g}",
                "each frame looks stretched to the full range: such a picture of depth is no depth",
                "store lengths with one scale for all frames",
            )
        ]
    levels = int(np.median([fact.levels for fact in facts]))
    if levels < FEW_LEVELS:
        return [
            Finding(
                "warning",
                "coarse-depth",
                where,
                None,
                f"a frame holds {levels} different depths",
                "surfaces become steps",
                "store 16 bits with a smaller step",
            )
        ]
    return []


def _unit(usual: float, where: str) -> list[Finding]:
    if NEAREST <= usual <= FARTHEST:
        return []
    guesses = ((256.0, "millimetres times 256"), (1e-3, "metres"), (0.1, "centimetres"), (1000.0, "micrometres"))
    likely = [text for factor, text in guesses if 20 <= usual / factor <= 200]
    guess = f"; it looks like {' or '.join(likely)}" if likely else ""
    return [
        Finding(
            "warning",
            "depth-unit",
            where,
            None,
            f"the median depth is {usual:.4g} mm{guess}",
            "learning rates and thresholds are in millimetres",
            "state the unit: prepare --depth-unit and --depth-scale, or [depth] in sequence.toml",
        )
    ]


def inverted_finding(
    depth: NDArray[np.float32], disparity: NDArray[np.float32], where: str, frame: int
) -> list[Finding]:
    """A refusal where depth grows with the disparity of the stereo pair: the picture is inverted, or is disparity."""
    both = (depth > 0) & np.isfinite(disparity) & (disparity > 0)
    if both.sum() < 500 or np.ptp(depth[both]) == 0:
        return []
    correlation = float(np.corrcoef(depth[both], 1.0 / disparity[both])[0, 1])
    if correlation > -0.5:
        return []
    return [
        Finding(
            "refusal",
            "inverted-depth",
            where,
            frame,
            f"depth falls where the stereo pair says far ({correlation:.2f})",
            "near and far are exchanged: the file holds disparity, or an inverted picture",
            "read it as disparity: endotsr depth --given FOLDER --kind disparity",
        )
    ]
