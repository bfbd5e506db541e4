"""The checks of `endotsr check` on frames that a training reads: refusals stop it, warnings become notes.

In: the frames that a reader collected, and the cameras. Out: sentences for the notes of the sequence, or an
`InputError` with the text of the finding.
"""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.agreement import agreement_findings, agreement_of
from endotsr.clips.sequences.checks.cameras import camera_findings
from endotsr.clips.sequences.checks.colour_planes import loaded_plane_findings
from endotsr.clips.sequences.checks.dark_border import loaded_border_findings
from endotsr.clips.sequences.checks.depth import DepthFacts, depth_findings, usual_depth
from endotsr.clips.sequences.checks.depth_steps import loaded_steps
from endotsr.clips.sequences.checks.displaced import loaded_displaced_findings
from endotsr.clips.sequences.checks.frames import FrameFacts, frame_findings, gap_findings, time_findings
from endotsr.clips.sequences.checks.kinds import Finding, worst_first
from endotsr.clips.sequences.checks.late import loaded_late_findings
from endotsr.clips.sequences.checks.loaded import first_pair_findings, loaded_depth_findings, loaded_mask_findings
from endotsr.clips.sequences.checks.masks import mask_findings
from endotsr.clips.sequences.checks.split_tissue import loaded_split_findings
from endotsr.clips.sequences.checks.still_parts import loaded_still_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError

# In other notes, or in refusals that come later and know more: on the polarity of masks, and on the first Gaussians.
SAID_ALREADY = ("assumed-depth", "far-from-origin", "frame-without-depth", "frame-without-tissue", "nothing-to-train")
COMMON = "common"  # the layout that `prepare` writes once the poses agree with the pictures
MOST = 5  # notes of one kind


def guarded(
    clip: Clip, frames: range, sequence: Sequence, facts: list[tuple[FrameFacts, DepthFacts]], near: float
) -> list[str]:
    """Notes on the findings on pictures, masks, depth and cameras. Raises InputError for the first refusal.

    facts   of the frames, in order
    """
    assert clip.depth is not None
    depth = with_coverage([prior for _, prior in facts], sequence.depth, sequence.masks)
    images, folder = [clip.images[i] for i in frames], str(clip.where)
    found = gap_findings(images) + time_findings(None if clip.times is None else clip.times[list(frames)], folder)
    found += frame_findings([picture for picture, _ in facts], str(images[0].parent))
    found += loaded_border_findings(sequence, str(images[0].parent))
    found += loaded_still_findings(sequence, str(images[0].parent))
    found += loaded_plane_findings(sequence, str(images[0].parent))
    if clip.masks and clip.masks.files:
        found += mask_findings(sequence.masks, str(clip.masks.files[0].parent))
        found += loaded_mask_findings(sequence, str(clip.masks.files[0].parent))
        folders = str(clip.masks.files[0].parent), str(clip.depth.files[0].parent)
        found += loaded_late_findings(sequence, *folders) or loaded_displaced_findings(sequence, folders[1])
    found += loaded_split_findings(sequence, folder)
    priors = str(clip.depth.files[0].parent)
    found += depth_findings(depth, priors, clip.arbitrary, near, clip.depth.assumed)
    found += loaded_steps(sequence).findings(priors)
    found += loaded_depth_findings(sequence, priors) + first_pair_findings(sequence, clip, frames)
    found += camera_findings(sequence.cameras, usual_depth(depth), folder, clip.crop)
    if (
        clip.layout != COMMON and not sequence.static_camera and not clip.pose_faults
    ):  # `prepare` has held the poses of the others
        found += agreement_findings(agreement_of(clip, clip.cameras(range(clip.count))), str(clip.stated_in))
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
