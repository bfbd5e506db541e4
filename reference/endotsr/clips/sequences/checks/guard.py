"""The checks of `endotsr check` on frames that a training reads: refusals stop it, warnings become notes.

In: the frames that a reader collected, and the cameras. Out: sentences for the notes of the sequence, or an
`InputError` with the text of the finding.
"""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.cameras import camera_findings
from endotsr.clips.sequences.checks.depth import DepthFacts, depth_findings, usual_depth
from endotsr.clips.sequences.checks.frames import frame_findings, gap_findings, time_findings
from endotsr.clips.sequences.checks.kinds import Finding, worst_first
from endotsr.clips.sequences.read_frames import FrameFiles, Frames
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera

SAID_ALREADY = ("assumed-depth", "far-from-origin", "frame-without-depth", "frame-without-tissue")  # in other notes
MOST = 5  # notes of one kind


def guarded(files: FrameFiles, frames: Frames, cameras: list[Camera], near: float) -> list[str]:
    """Notes on the findings of the checks of pictures, depth and cameras. Raises InputError for the first refusal."""
    pictures, depth = frames.facts
    depth = with_coverage(depth, frames.depth, frames.masks)
    folder = str(files.images[0].parents[1])
    found = gap_findings(files.images) + time_findings(files.seconds, folder)
    found += frame_findings(pictures, str(files.images[0].parent))
    found += depth_findings(depth, str(files.depth[0].parent), files.arbitrary, near, files.assumed)
    found += camera_findings(cameras, usual_depth(depth), folder)
    return notes_of([finding for finding in found if finding.code not in SAID_ALREADY])


def notes_of(findings: list[Finding]) -> list[str]:
    """One sentence per finding, worst first, at most `MOST` of a kind. Raises InputError for a refusal."""
    findings = worst_first(findings)
    for finding in findings:
        if finding.level == "refusal":
            raise InputError(finding.line)
    totals, said, notes = Counter(finding.code for finding in findings), Counter[str](), []
    for finding in findings:
        said[finding.code] += 1
        if said[finding.code] <= MOST:
            place = "" if finding.frame is None else f"frame {finding.frame}: "
            rest = totals[finding.code] - MOST
            more = f" ({rest} more of this kind)" if said[finding.code] == MOST and rest > 0 else ""
            notes.append(f"{finding.level}: {finding.code}: {place}{finding.what}; {finding.why}{more}")
    return notes


def with_coverage(facts: list[DepthFacts], depth: NDArray[np.float32], masks: NDArray[np.bool_]) -> list[DepthFacts]:
    """The facts on the depth with the fraction of tissue that has depth. depth, masks: (n, H, W)."""
    found = []
    for fact, plane, mask in zip(facts, depth, masks):
        tissue = np.count_nonzero(mask)
        covered = np.count_nonzero((plane > 0) & mask) / tissue if tissue else 1.0
        found.append(fact._replace(tissue_coverage=covered))
    return found
