"""One pass over the frames of a clip, which keeps what the checks need of them.

In: a `Clip` of a layout that training reads directly. Out: a `FramePass` with the findings on single files, and the
state of the checks that see one frame after another. Frames are read one at a time. An unreadable file becomes a
finding, and the pass continues.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.colour_planes import ColourPlanes
from endotsr.clips.sequences.checks.depth import DepthFacts, depth_facts, light_correlation
from endotsr.clips.sequences.checks.depth_pair import DepthPairs
from endotsr.clips.sequences.checks.depth_steps import DepthSteps
from endotsr.clips.sequences.checks.displaced import DisplacedDepth
from endotsr.clips.sequences.checks.flips import DepthTurns, Fit, pair_finding, shading_fit
from endotsr.clips.sequences.checks.frames import FrameFacts, frame_facts
from endotsr.clips.sequences.checks.kinds import Finding, finding, tried
from endotsr.clips.sequences.checks.late import LateParts
from endotsr.clips.sequences.checks.masks import MaskSteps
from endotsr.clips.sequences.checks.specks import Specks
from endotsr.clips.sequences.checks.split_tissue import SplitTissue
from endotsr.clips.sequences.checks.stereo import PairViews
from endotsr.clips.sequences.checks.still_parts import StillParts
from endotsr.clips.sequences.clip import Clip, Picture, colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import depth_plane, read_plane
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.clips.sequences.mask_values import MaskLevels
from endotsr.clips.sequences.masks import tissue_masks
from endotsr.clips.sequences.pairing import matching_files
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.view_frames import frame_of
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray

T = TypeVar("T")
Size = tuple[int, ...]  # height, width
Depth = NDArray[np.float32]  # (H, W) scene units, 0 = none
SAMPLED = 16  # frames whose masks are checked against pictures and depth
SHOWN = 4  # of these, in the report
STEP = 4  # pixels between their sampled rows and columns


class Sample(NamedTuple):
    """A frame at every fourth pixel."""

    name: str
    picture: Picture  # (h, w, 3)
    tissue: BoolArray  # (h, w)
    depth: Depth  # (h, w)


class FramePass:
    """Findings on the files of a clip, and what is kept of its frames."""

    def __init__(self, clip: Clip) -> None:
        count = len(clip.images)
        self.clip = clip
        self.size: Size | None = None  # of the first readable picture
        self.findings: list[Finding] = []
        self.frames: list[FrameFacts] = []
        self.masks, self.specks = MaskSteps(), Specks()
        self.view, self.late, self.still = FieldOfView(), LateParts(), StillParts(count)
        self.planes, self.displaced = ColourPlanes(count), DisplacedDepth(count)
        self.depth: list[DepthFacts] = []
        self.steps, self.turns, self.of_split = DepthSteps(count), DepthTurns(), SplitTissue(count)
        self.views, self.against = PairViews(count), DepthPairs(clip)
        self.samples: list[Sample] = []
        self.pictures: list[tuple[str, NDArray[np.uint8]]] = []  # the first samples, for the report
        self.light: list[float] = []  # rank correlation of brightness with depth, for the sampled frames
        self.shading: list[Fit] = []  # for the sampled frames where it can be determined

    def tried(self, make: Callable[[], T], code: str, where: object, frame: int | None = None) -> T | None:
        """The value, or None with a refusal among the findings."""
        return tried(self.findings, make, code, where, frame)

    def read(self) -> None:
        """Read every frame once."""
        masks, depth = (self._paired(part.files if part else []) for part in (self.clip.masks, self.clip.depth))
        sampled = set(even_frames(len(self.clip.images), SAMPLED))
        levels = self._mask_levels()
        for i, file in enumerate(self.clip.images):
            picture = self._sized(lambda file=file: colour_picture(read_picture(file), file), "picture", file, i)
            if picture is None:
                self.masks.add(i, None)
                continue
            self.size = self.size or picture.shape[:2]
            self.frames.append(frame_facts(file.name, picture))
            tissue = self._tissue(masks[i], i, levels)
            found = self._depth(depth[i], i, tissue)
            self._keep(i, picture, tissue, found)
            if i in sampled:
                self._sample(file, picture, tissue, found)
            self._keep_pair(i, picture, tissue, found)

    def _keep(self, i: int, picture: Picture, tissue: BoolArray | None, depth: Depth | None) -> None:
        """Add frame i to the checks that see one frame after another."""
        self.masks.add(i, tissue)
        self.specks.add(i, tissue)
        self.view.add(picture, tissue)
        self.still.add(i, picture, tissue)
        self.planes.add(i, picture)
        self.steps.add(i, picture, depth, tissue)
        self.late.add(picture, tissue, depth)
        self.turns.add(i, depth)
        self.displaced.add(i, tissue, depth)
        self.of_split.add(i, tissue, depth)

    def _sized(self, make: Callable[[], NDArray], code: str, file: Path, i: int) -> NDArray | None:
        """As `tried`, for the array of a file, which another size than that of the first picture refuses as well."""
        found = self.tried(make, code, file, i)
        if found is None or self.size is None or found.shape[:2] == self.size:
            return found
        height, width = self.size
        what = f"{found.shape[1]}x{found.shape[0]} pixels, the first picture has {width}x{height}"
        self.findings.append(finding("size", file, what, i))
        return None

    def _paired(self, files: list[Path]) -> list[Path | None]:
        """The file of each frame; None for all where the check of the pairing reports the files."""
        try:
            return matching_files(self.clip.images, files) if files else [None] * len(self.clip.images)
        except InputError:
            return [None] * len(self.clip.images)

    def _mask_levels(self) -> MaskLevels | None:
        """What the numbers of the masks mean; None without masks, or with a finding."""
        masks = self.clip.masks
        if masks is None or masks.levels is None or not masks.files:
            return None
        return self.tried(masks.levels, "mask-values", masks.files[0].parent)

    def _tissue(self, file: Path | None, i: int, levels: MaskLevels | None) -> BoolArray | None:
        """The mask of frame i; None without one, or with a finding."""
        if file is None or self.clip.masks is None:
            return None
        excluded = self.clip.masks.excluded_value
        plane = self._sized(lambda: grey_plane(read_picture(file), file), "mask", file, i)
        if plane is None or levels is None:
            return None
        read = lambda: tissue_masks([plane], [str(file)], excluded, levels=levels)[0]
        tissue = self.tried(read, "mask-values", file, i)
        if tissue is not None and not tissue.any():
            self.findings.append(finding("frame-without-tissue", file, "the mask excludes every pixel", i))
        return tissue

    def _depth(self, file: Path | None, i: int, tissue: BoolArray | None) -> Depth | None:
        """The depth of frame i; None without it, or with a finding."""
        if file is None or self.clip.depth is None:
            return None
        scale = self.clip.depth.scale
        stored = self._sized(lambda: read_plane(file), "depth-file", file, i)
        if stored is None:
            return None
        depth = self.tried(lambda: depth_plane(stored, scale, file), "depth-values", file, i)
        if depth is not None:
            self.depth.append(depth_facts(file.name, depth, stored, tissue))
        return depth

    def _sample(self, file: Path, picture: Picture, tissue: BoolArray | None, depth: Depth | None) -> None:
        """Keep a frame at every fourth pixel, and compare its light with its depth."""
        if depth is not None:
            self.light.append(light_correlation(picture, depth, tissue))
            self.shading += filter(None, [shading_fit(picture, depth, tissue)])
        small = np.ascontiguousarray(picture[::STEP, ::STEP])
        if len(self.pictures) < SHOWN:
            self.pictures.append((file.name, small))
        if tissue is not None:
            sparse = np.zeros_like(small[:, :, 0], np.float32) if depth is None else depth[::STEP, ::STEP]
            self.samples.append(Sample(file.name, small, tissue[::STEP, ::STEP], sparse))

    def _keep_pair(self, i: int, picture: Picture, tissue: BoolArray | None, depth: Depth | None) -> None:
        """Compare the right view of frame i with the left one and with the depth. Training does not read it."""
        clip = self.clip
        if len(clip.right) != len(clip.images):
            return  # reported by the check of the pairing
        try:
            right = colour_picture(read_picture(clip.right[i]), clip.right[i])
        except InputError:
            return  # `depth` names the file
        self.views.add(i, picture, right)
        if depth is None or clip.depth is None or right.shape != picture.shape:
            return
        if i == 0:
            self.findings += pair_finding(picture, right, depth, str(clip.depth.files[0]), 0)
        if i in self.against.sampled and (tissue is not None or not clip.masks):
            with suppress(InputError):  # the check of the cameras reports it
                self.against.add(i, frame_of(picture, tissue, depth), right)
