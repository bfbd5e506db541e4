"""`endotsr check`: one pass over a sequence that collects every finding.

In: a folder in the common format or in the EndoNeRF layout, and the settings. Out: `Checked`. Frames are read one at a
time. An unreadable file becomes a finding, and the pass continues.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import has_truth
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.agreement import agreement_findings, agreement_of
from endotsr.clips.sequences.checks.cameras import baseline_findings, camera_findings
from endotsr.clips.sequences.checks.cost import Cost, estimated_cost
from endotsr.clips.sequences.checks.dark_border import border_findings
from endotsr.clips.sequences.checks.depth import (
    DepthFacts,
    depth_facts,
    depth_findings,
    light_correlation,
    light_finding,
    usual_depth,
)
from endotsr.clips.sequences.checks.depth_pair import DepthPairs
from endotsr.clips.sequences.checks.depth_steps import DepthSteps, scale_finding
from endotsr.clips.sequences.checks.duration import ASSUMED as ASSUMED_SPEED
from endotsr.clips.sequences.checks.duration import Frames, Speed, expected_frames, frames_of
from endotsr.clips.sequences.checks.flips import (
    DepthTurns,
    Fit,
    agreed_disparity,
    shading_finding,
    shading_fit,
    stereo_finding,
)
from endotsr.clips.sequences.checks.frames import (
    FrameFacts,
    frame_facts,
    frame_findings,
    gap_findings,
    profile_findings,
    rate_findings,
    time_findings,
)
from endotsr.clips.sequences.checks.kinds import Finding, finding, worst_first
from endotsr.clips.sequences.checks.late import LateParts
from endotsr.clips.sequences.checks.masks import MaskSteps
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.checks.specks import Specks
from endotsr.clips.sequences.checks.split_tissue import SplitTissue, split_findings
from endotsr.clips.sequences.checks.stereo import PairViews
from endotsr.clips.sequences.checks.still_parts import StillParts
from endotsr.clips.sequences.clip import Clip, Picture, colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import depth_plane, read_plane
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.layouts import describe_for_training
from endotsr.clips.sequences.mask_polarity import check_polarity, check_single_masks
from endotsr.clips.sequences.mask_values import MaskLevels
from endotsr.clips.sequences.masks import check_tissue_fraction, tissue_masks
from endotsr.clips.sequences.pairing import matching_files
from endotsr.clips.sequences.smaller import trained_size
from endotsr.clips.sequences.splits import even_frames, parse_frame_range, split_frames
from endotsr.clips.sequences.view_frames import frame_of
from endotsr.config import Config, lengthened, with_fixed_length
from endotsr.errors import InputError
from endotsr.method.kernels.machine import memory_of_machine
from endotsr.method.kernels.memory import ASSUMED, unknown_memory

T = TypeVar("T")
Size = tuple[int, ...]  # height, width
SAMPLED = 16  # frames whose masks are checked against pictures and depth
STEP = 4  # pixels between their sampled rows and columns


class Checked(NamedTuple):
    """The result of a check."""

    source: str
    findings: list[Finding]  # refusals first
    facts: dict[str, Any]  # frames, width, height, and the cost
    pictures: list[tuple[str, NDArray[np.uint8]]]  # caption and small picture (h, w, 3), for a report

    @property
    def refused(self) -> bool:
        """Whether a training would refuse the sequence."""
        return any(finding.level == "refusal" for finding in self.findings)


class _Pass:
    """Findings, and facts kept from the frames."""

    def __init__(self, clip: Clip) -> None:
        count = len(clip.images)
        self.findings: list[Finding] = []
        self.frames: list[FrameFacts] = []
        self.masks, self.specks = MaskSteps(), Specks()
        self.view, self.late = FieldOfView(), LateParts()
        self.still = StillParts(count)
        self.depth: list[DepthFacts] = []
        self.steps = DepthSteps(count)
        self.of_split = SplitTissue(count)
        self.views, self.against = PairViews(count), DepthPairs(clip)
        self.samples: list[tuple[str, NDArray, NDArray[np.bool_], NDArray]] = []
        self.pictures: list[tuple[str, NDArray[np.uint8]]] = []
        self.light: list[float] = []  # rank correlation of brightness with depth, for the sampled frames
        self.turns = DepthTurns()
        self.shading: list[Fit] = []  # for the sampled frames where it can be determined

    def tried(self, make: Callable[[], T], code: str, where: object, frame: int | None = None) -> T | None:
        """The value, or None with a refusal among the findings."""
        try:
            return make()
        except InputError as error:
            self.findings.append(finding(code, where, " ".join(str(error).split()), frame))
            return None

    def sized(self, make: Callable[[], NDArray], code: str, file: Path, i: int, size: Size | None) -> NDArray | None:
        """As `tried`, for the array of a file, which another size than `size` refuses as well."""
        found = self.tried(make, code, file, i)
        if found is None or size is None or found.shape[:2] == size:
            return found
        what = f"{found.shape[1]}x{found.shape[0]} pixels, the first picture has {size[1]}x{size[0]}"
        self.findings.append(finding("size", file, what, i))
        return None


def check_sequence(path: Path, config: Config, speed: Speed = ASSUMED_SPEED) -> Checked:
    """Every finding on the sequence at `path`.

    speed    of the machine, for the time of a training

    Raises:  InputError only if there is nothing to check: no folder, or a layout that needs `endotsr prepare`.
    """
    if not Path(path).exists():
        raise InputError(f"{path}: sequence folder not found")
    clip = describe_for_training(path, config.sequence)
    run = _Pass(clip)
    run.findings += clip.faults + _stated(clip)
    if not clip.images:
        return Checked(str(path), worst_first(run.findings), {}, [])
    run.findings += profile_findings(clip.images) + gap_findings(clip.images)
    run.findings += time_findings(clip.times, where := str(clip.where)) + rate_findings(clip.times, clip.rate, where)
    size = _read_frames(clip, run)
    facts: dict[str, Any] = {"frames": len(clip.images)}
    if run.frames:
        run.findings += frame_findings(run.frames, str(clip.images[0].parent))
        run.findings += border_findings(run.view, str(clip.images[0].parent))
        run.findings += run.still.findings(str(clip.images[0].parent))
    if clip.masks and clip.masks.files:
        run.findings += run.masks.findings(str(clip.masks.files[0].parent))
        run.findings += run.specks.findings(str(clip.masks.files[0].parent))
        priors = clip.depth.files[0].parent if clip.depth and clip.depth.files else clip.where
        run.findings += run.late.findings(str(clip.masks.files[0].parent), str(priors))
    if run.depth and clip.depth:
        where, near = str(clip.depth.files[0].parent), config.raster.near
        run.findings += depth_findings(run.depth, where, clip.arbitrary, near, clip.depth.assumed)
        run.findings += scale_finding(run.steps.found, where)
        run.findings += light_finding(run.light, where) + shading_finding(run.shading, where)
        run.findings += run.turns.findings(where)
    run.findings += run.views.findings(clip.right) + run.against.findings()
    run.findings += baseline_findings(clip.baseline if clip.right else None, clip.arbitrary, str(clip.stated_in))
    if run.samples:
        _check_masks(clip, run, config)
    config, frames = _of_length(clip, config, run)
    if size:
        facts |= {"frames": frames.total, "width": size[1], "height": size[0]}
        scale = config.sequence.scale
        run.tried(lambda: trained_size(size[1], size[0], scale, clip.where), "picture-size", clip.where)
        if not any(fault.code == "cameras" for fault in clip.faults):
            facts |= _check_cameras(clip, run, size)
        facts["cost"] = _cost(clip, size, config, frames, speed, run)._asdict()
    return Checked(str(path), worst_first(_of_frames(run.findings, clip, config)), facts, run.pictures)


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


def _check_cameras(clip: Clip, run: _Pass, size: Size) -> dict[str, str]:
    """Findings on the intrinsics and the poses of all frames. Returns whether the poses explain the pictures."""
    camera, where = clip.intrinsics, clip.stated_in
    if camera and (camera.height, camera.width) != size:
        what = f"{where}: states {camera.width}x{camera.height}, the pictures have {size[1]}x{size[0]}"
        run.findings.append(finding("sequence-file" if clip.layout == "common" else "cameras", where, what))
        return {}
    cameras = run.tried(lambda: clip.cameras(range(clip.count)), "cameras", where)
    if not cameras:
        return {}
    run.findings += camera_findings(cameras, usual_depth(run.depth), str(where), clip.crop)
    poses = agreement_of(clip, cameras)
    run.findings += agreement_findings(poses, str(where))
    return {} if poses is None else {"poses": poses.sentence}


def _read_frames(clip: Clip, run: _Pass) -> Size | None:
    """Read every frame once. Returns the size of the first readable picture."""
    masks, depth = (_paired(clip.images, part.files if part else []) for part in (clip.masks, clip.depth))
    sampled = set(even_frames(len(clip.images), SAMPLED))
    levels = _mask_levels(clip, run)
    size = None
    for i, file in enumerate(clip.images):
        picture = run.sized(lambda file=file: colour_picture(read_picture(file), file), "picture", file, i, size)
        if picture is None:
            run.masks.add(i, None)
            continue
        size = size or picture.shape[:2]
        run.frames.append(frame_facts(file.name, picture))
        tissue = _mask(clip, run, masks[i], i, size, levels)
        run.masks.add(i, tissue)
        run.specks.add(i, tissue)
        run.view.add(picture, tissue)
        run.still.add(i, picture, tissue)
        found = _depth(clip, run, depth[i], i, size, tissue)
        run.steps.add(i, picture, found, tissue)
        run.late.add(picture, tissue, found)
        run.turns.add(i, found)
        run.of_split.add(i, tissue, found)
        if i in sampled:
            if found is not None:
                run.light.append(light_correlation(picture, found, tissue))
                run.shading += filter(None, [shading_fit(picture, found, tissue)])
            _sample(run, file, picture, tissue, found)
        _pair(clip, run, i, picture, tissue, found)
    return size


def _paired(images: list[Path], files: list[Path]) -> list[Path | None]:
    try:
        return matching_files(images, files) if files else [None] * len(images)
    except InputError:
        return [None] * len(images)  # reported by the check of the pairing


def _mask_levels(clip: Clip, run: _Pass) -> MaskLevels | None:
    """What the numbers of the masks mean; None without masks, or with a finding."""
    if clip.masks is None or clip.masks.levels is None or not clip.masks.files:
        return None
    return run.tried(clip.masks.levels, "mask-values", clip.masks.files[0].parent)


def _mask(
    clip: Clip, run: _Pass, file: Path | None, i: int, size: Size, levels: MaskLevels | None
) -> NDArray[np.bool_] | None:
    if file is None or clip.masks is None:
        return None
    excluded = clip.masks.excluded_value
    plane = run.sized(lambda: grey_plane(read_picture(file), file), "mask", file, i, size)
    if plane is None:
        return None
    if levels is None:
        return None
    read = lambda: tissue_masks([plane], [str(file)], excluded, levels=levels)[0]
    tissue = run.tried(read, "mask-values", file, i)
    if tissue is not None and not tissue.any():
        run.findings.append(finding("frame-without-tissue", file, "the mask excludes every pixel", i))
    return tissue


def _depth(
    clip: Clip, run: _Pass, file: Path | None, i: int, size: Size, tissue: NDArray[np.bool_] | None
) -> NDArray[np.float32] | None:
    if file is None or clip.depth is None:
        return None
    scale = clip.depth.scale
    stored = run.sized(lambda: read_plane(file), "depth-file", file, i, size)
    if stored is None:
        return None
    depth = run.tried(lambda: depth_plane(stored, scale, file), "depth-values", file, i)
    if depth is None:
        return None
    run.depth.append(depth_facts(file.name, depth, stored, tissue))
    return depth


def _sample(run: _Pass, file: Path, picture: NDArray, tissue: NDArray | None, depth: NDArray | None) -> None:
    small = np.ascontiguousarray(picture[::STEP, ::STEP])
    if len(run.pictures) < 4:
        run.pictures.append((file.name, small))
    if tissue is not None:
        sparse = np.zeros_like(small[:, :, 0], np.float32) if depth is None else depth[::STEP, ::STEP]
        run.samples.append((file.name, small, tissue[::STEP, ::STEP], sparse))


def _pair(clip: Clip, run: _Pass, i: int, picture: Picture, tissue: NDArray | None, depth: NDArray | None) -> None:
    """The right view of a frame, against the left one and against the depth. Training does not read it."""
    if len(clip.right) != len(clip.images):
        return  # reported by the check of the pairing
    try:
        right = colour_picture(read_picture(clip.right[i]), clip.right[i])
    except InputError:
        return  # `depth` names the file
    run.views.add(i, picture, right)
    if depth is None or clip.depth is None or right.shape != picture.shape:
        return
    if i == 0 and (disparity := agreed_disparity(picture, right)) is not None:
        run.findings += stereo_finding(depth, disparity, str(clip.depth.files[0]), 0)
    if i in run.against.sampled and (tissue is not None or not clip.masks):
        with suppress(InputError):  # the check of the cameras reports it
            run.against.add(i, frame_of(picture, tissue, depth), right)


def _check_masks(clip: Clip, run: _Pass, config: Config) -> None:
    """Polarity and tissue fraction on sampled frames, with the rules of training."""
    names = [name for name, *_ in run.samples]
    images = np.stack([small.transpose(2, 0, 1) for _, small, _, _ in run.samples])
    masks, depth = (np.stack([sample[k] for sample in run.samples]) for k in (2, 3))
    assert clip.masks is not None
    where, allow = str(clip.masks.files[0].parent), config.sequence.allow_tissue_fraction
    excluded, stated_in = clip.masks.excluded_value, clip.masks.stated_in
    evidence = MaskEvidence(step=1)
    for _, small, tissue, sparse in run.samples:
        evidence.add(small, tissue, sparse)
    run.findings += evidence.flip_findings(where)
    if run.tried(lambda: check_tissue_fraction(masks, where, excluded, allow), "tissue-fraction", where) is None:
        return
    if (
        run.tried(lambda: check_polarity(masks, depth, images, where, excluded, allow, stated_in), "polarity", where)
        is None
    ):
        return
    run.tried(lambda: check_single_masks(masks, depth, images, names, allow), "single-mask", where)


def _cost(clip: Clip, size: Size, config: Config, frames: Frames, speed: Speed, run: _Pass) -> Cost:
    """Memory, disk and time of a training, with findings if they are insufficient."""
    height, width, count, where = *size[:2], frames.total, str(clip.where)
    cost = estimated_cost(frames, width, height, config, speed)
    run.tried(lambda: FrameStore(count, width, height, config.sequence.memory, where), "disk", where)
    if cost.file_bytes:
        what = f"the frames need {cost.file_bytes / 1e9:.1f} GB and are stored in a file during training"
        run.findings.append(finding("frames-in-file", where, what))
    memory = memory_of_machine() or ASSUMED
    if cost.total_bytes > memory:
        has = unknown_memory() or f"this machine has {memory / 1e9:.1f} GB"
        what = f"a training needs about {cost.total_bytes / 1e9:.1f} GB, {has}"
        run.findings.append(finding("memory", where, what))
    return cost


def _of_length(clip: Clip, config: Config, run: _Pass) -> tuple[Config, Frames]:
    """The settings with the length of a training on these frames. An impossible split becomes a finding."""

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
