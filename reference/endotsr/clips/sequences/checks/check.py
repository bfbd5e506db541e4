"""`endotsr check`: every finding on a sequence, worst first.

In: a folder in the common format or in the EndoNeRF layout, and the settings. Out: `Checked`. `frame_pass` reads the
frames; what is said here follows from all of them, and from what the files state.
"""

from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import has_truth
from endotsr.clips.sequences.checks.agreement import agreement_findings, agreement_of
from endotsr.clips.sequences.checks.cameras import baseline_findings, camera_findings
from endotsr.clips.sequences.checks.dark_border import border_findings
from endotsr.clips.sequences.checks.depth import depth_findings, light_finding, usual_depth
from endotsr.clips.sequences.checks.flips import shading_finding
from endotsr.clips.sequences.checks.frame_pass import FramePass
from endotsr.clips.sequences.checks.frames import (
    frame_findings,
    gap_findings,
    profile_findings,
    rate_findings,
    time_findings,
)
from endotsr.clips.sequences.checks.kinds import Finding, finding, worst_first
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.checks.split_tissue import split_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.forecast.cost import Cost, estimated_cost
from endotsr.clips.sequences.forecast.seconds import ASSUMED as ASSUMED_SPEED
from endotsr.clips.sequences.forecast.seconds import Frames, Speed, expected_frames, frames_of
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.layouts import describe_for_training
from endotsr.clips.sequences.mask_polarity import check_polarity, check_single_masks
from endotsr.clips.sequences.masks import check_tissue_fraction
from endotsr.clips.sequences.smaller import trained_size
from endotsr.clips.sequences.splits import parse_frame_range, split_frames
from endotsr.config import Config, lengthened, with_fixed_length
from endotsr.errors import InputError
from endotsr.method.kernels.machine import memory_of_machine
from endotsr.method.kernels.memory import ASSUMED, unknown_memory


class CheckFacts(TypedDict, total=False):
    """What a check tells of a sequence besides the findings."""

    frames: int  # that the settings select
    width: int  # pixels
    height: int
    poses: str  # whether the poses explain the pictures, in words; absent for a static camera
    cost: dict[str, float]  # the fields of `Cost`


class Checked(NamedTuple):
    """The result of a check."""

    source: str
    findings: list[Finding]  # refusals first
    facts: CheckFacts
    pictures: list[tuple[str, NDArray[np.uint8]]]  # caption and small picture (h, w, 3), for a report

    @property
    def refused(self) -> bool:
        """Whether a training would refuse the sequence."""
        return any(finding.level == "refusal" for finding in self.findings)


def check_sequence(path: Path, config: Config, speed: Speed = ASSUMED_SPEED) -> Checked:
    """Every finding on the sequence at `path`.

    speed    of the machine, for the time of a training

    Raises:  InputError only if there is nothing to check: no folder, or a layout that needs `endotsr prepare`.
    """
    if not Path(path).exists():
        raise InputError(f"{path}: sequence folder not found")
    clip = describe_for_training(path, config.sequence)
    run = FramePass(clip)
    run.findings += clip.faults + _stated(clip)
    if not clip.images:
        return Checked(str(path), worst_first(run.findings), {}, [])
    run.findings += profile_findings(clip.images) + gap_findings(clip.images)
    run.findings += time_findings(clip.times, str(clip.where)) + rate_findings(clip.times, clip.rate, str(clip.where))
    run.read()
    run.findings += [*_of_pictures(run), *_of_masks(run), *_of_depth(run, config), *_of_pairs(run)]
    if run.samples:
        _check_masks(run, config)
    facts = _with_training(run, config, speed)
    return Checked(str(path), worst_first(_of_frames(run.findings, clip, config)), facts, run.pictures)


def _of_pictures(run: FramePass) -> list[Finding]:
    """Findings on the pictures of all frames."""
    where = str(run.clip.images[0].parent)
    if not run.frames:
        return []
    still = run.still.findings(where)
    return [*frame_findings(run.frames, where), *border_findings(run.view, where), *still, *run.planes.findings(where)]


def _of_masks(run: FramePass) -> list[Finding]:
    """Findings on the masks of all frames, and on those of another moment."""
    masks, depth = run.clip.masks, run.clip.depth
    if masks is None or not masks.files:
        return []
    where = str(masks.files[0].parent)
    priors = depth.files[0].parent if depth and depth.files else run.clip.where
    apart = run.late.findings(where, str(priors)) or run.displaced.findings(str(priors))
    return [*run.masks.findings(where), *run.specks.findings(where), *apart]


def _of_depth(run: FramePass, config: Config) -> list[Finding]:
    """Findings on the depth of all frames."""
    depth = run.clip.depth
    if not run.depth or depth is None:
        return []
    where = str(depth.files[0].parent)
    return [
        *depth_findings(run.depth, where, run.clip.arbitrary, config.raster.near, depth.assumed),
        *run.steps.findings(where),
        *light_finding(run.light, where),
        *shading_finding(run.shading, where),
        *run.turns.findings(where),
    ]


def _of_pairs(run: FramePass) -> list[Finding]:
    """Findings on the right views, against the left ones and against the depth, and on their distance."""
    clip = run.clip
    baseline = clip.baseline if clip.right else None
    return [
        *run.views.findings(clip.right),
        *run.against.findings(),
        *baseline_findings(baseline, clip.arbitrary, str(clip.stated_in)),
    ]


def _with_training(run: FramePass, config: Config, speed: Speed) -> CheckFacts:
    """Add the findings on the split, the size and the cameras; returns the facts, with the cost of a training."""
    clip, facts = run.clip, CheckFacts(frames=len(run.clip.images))
    config, frames = _of_length(run, config)
    if run.size is None:
        return facts
    height, width = run.size[:2]
    facts |= {"frames": frames.total, "width": width, "height": height}
    scale = config.sequence.scale
    run.tried(lambda: trained_size(width, height, scale, clip.where), "picture-size", clip.where)
    if not any(fault.code == "cameras" for fault in clip.faults) and (sentence := _check_cameras(run, (height, width))):
        facts["poses"] = sentence
    facts["cost"] = _cost(run, width, height, config, frames, speed)._asdict()
    return facts


def _of_frames(findings: list[Finding], clip: Clip, config: Config) -> list[Finding]:
    """The findings on the frames that the settings select, and on the whole clip. A wrong range is a finding."""
    try:
        chosen = parse_frame_range(config.sequence.frames, clip.count)
    except InputError:
        return findings
    return [found for found in findings if found.frame is None or found.frame in chosen]


def _origin(clip: Clip) -> str:
    return f": excluded pixels {clip.masks.origin}" if clip.masks and clip.masks.origin else ""


def _stated(clip: Clip) -> list[Finding]:
    """Findings on what the files of a clip state."""
    found, where = [finding("not-read", clip.where, said) for said in clip.not_read], clip.stated_in
    broken = {fault.code for fault in clip.faults}
    if clip.depth is None and not broken & {"depth-files", "sequence-file"}:
        found.append(finding("no-depth", where, "[depth] is missing"))
    if clip.masks is None and not broken & {"masks-files", "sequence-file"}:
        found.append(finding("no-masks", where, "there are no masks"))
    elif clip.masks and clip.masks.proposed:
        found.append(finding("proposed-masks", where, f"a program proposed the masks{_origin(clip)}"))
    if clip.intrinsics and any(clip.intrinsics.distortion):
        found.append(finding("distortion", where, "the pictures are distorted"))
    return found


def _check_cameras(run: FramePass, size: tuple[int, int]) -> str:
    """Add the findings on the intrinsics and the poses of all frames.

    size      height and width of the pictures
    returns   whether the poses explain the pictures, in words; "" for a static camera, or with a refusal
    """
    clip, where = run.clip, run.clip.stated_in
    camera = clip.intrinsics
    if camera and (camera.height, camera.width) != size:
        what = f"{where}: states {camera.width}x{camera.height}, the pictures have {size[1]}x{size[0]}"
        run.findings.append(finding("sequence-file" if clip.layout == "common" else "cameras", where, what))
        return ""
    cameras = run.tried(lambda: clip.cameras(range(clip.count)), "cameras", where)
    if not cameras:
        return ""
    run.findings += camera_findings(cameras, usual_depth(run.depth), str(where), clip.crop)
    poses = agreement_of(clip, cameras)
    run.findings += agreement_findings(poses, str(where))
    return "" if poses is None else poses.sentence


def _check_masks(run: FramePass, config: Config) -> None:
    """Add the findings on polarity and tissue fraction of the sampled frames, by the rules of training."""
    clip, samples = run.clip, run.samples
    names = [sample.name for sample in samples]
    images = np.stack([sample.picture.transpose(2, 0, 1) for sample in samples])
    tissue, depth = np.stack([sample.tissue for sample in samples]), np.stack([sample.depth for sample in samples])
    assert clip.masks is not None
    where, allow = str(clip.masks.files[0].parent), config.sequence.allow_tissue_fraction
    excluded, stated_in = clip.masks.excluded_value, clip.masks.stated_in
    evidence = MaskEvidence(step=1)
    for sample in samples:
        evidence.add(sample.picture, sample.tissue, sample.depth)
    run.findings += evidence.flip_findings(where)
    fraction = lambda: check_tissue_fraction(tissue, where, excluded, allow)
    polarity = lambda: check_polarity(tissue, depth, images, where, excluded, allow, stated_in)
    if run.tried(fraction, "tissue-fraction", where) is None or run.tried(polarity, "polarity", where) is None:
        return  # the first refusal says enough
    run.tried(lambda: check_single_masks(tissue, depth, images, names, allow), "single-mask", where)


def _cost(run: FramePass, width: int, height: int, config: Config, frames: Frames, speed: Speed) -> Cost:
    """Memory, disk and time of a training, with findings if they are insufficient."""
    where = str(run.clip.where)
    cost = estimated_cost(frames, width, height, config, speed)
    run.tried(lambda: FrameStore(frames.total, width, height, config.sequence.memory, where), "disk", where)
    if cost.file_bytes:
        what = f"the frames need {cost.file_bytes / 1e9:.1f} GB and are stored in a file during training"
        run.findings.append(finding("frames-in-file", where, what))
    memory = memory_of_machine() or ASSUMED
    if cost.total_bytes > memory:
        has = unknown_memory() or f"this machine has {memory / 1e9:.1f} GB"
        what = f"a training needs about {cost.total_bytes / 1e9:.1f} GB, {has}"
        run.findings.append(finding("memory", where, what))
    return cost


def _of_length(run: FramePass, config: Config) -> tuple[Config, Frames]:
    """The settings with the length of a training on these frames. An impossible split becomes a finding."""
    clip = run.clip

    def frames_and_tissue() -> Frames:
        chosen = parse_frame_range(config.sequence.frames, len(clip.images))
        split = split_frames(len(chosen), config.sequence.split, config.sequence.block_length)
        if not any(finding.level == "refusal" for finding in run.findings):  # which says the same of all frames
            tissue, lifted = (part[list(chosen)] for part in (run.of_split.tissue, run.of_split.lifted))
            run.findings += split_findings(tissue, lifted, split, str(clip.where))
        found = frames_of(*split)
        return found.with_true_motion() if has_truth(clip.where) else found

    frames = run.tried(frames_and_tissue, "frames", clip.where)
    if frames is None:
        return with_fixed_length(config), expected_frames(len(clip.images), config)
    return lengthened(config, frames.training), frames
