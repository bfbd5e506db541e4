"""What `endotsr prepare` sees of the frames that it writes, by the checks of `endotsr check` that need one pass."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.choices import Border
from endotsr.clips.sequences.checks.colour_planes import ColourPlanes
from endotsr.clips.sequences.checks.dark_border import border_findings
from endotsr.clips.sequences.checks.depth import rim_finding
from endotsr.clips.sequences.checks.depth_rims import blended_rim
from endotsr.clips.sequences.checks.depth_steps import DepthSteps
from endotsr.clips.sequences.checks.displaced import DisplacedDepth
from endotsr.clips.sequences.checks.exchanged import MaskOrder
from endotsr.clips.sequences.checks.flips import DepthTurns
from endotsr.clips.sequences.checks.guard import notes_of
from endotsr.clips.sequences.checks.held import HeldMasks
from endotsr.clips.sequences.checks.late import LateParts
from endotsr.clips.sequences.checks.masks import MaskTurns
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.checks.specks import Specks
from endotsr.clips.sequences.checks.stereo import PairViews
from endotsr.clips.sequences.checks.still_parts import StillParts
from endotsr.clips.sequences.clip import Clip, PicturePair
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.method.kernels.arrays import BoolArray

NEAR = 10.0  # mm; endoscopes work nearer, and depth in centimetres looks like it
FAR = 150.0  # mm; laparoscopes work farther, and 5000 steps a metre, read as millimetres, look like it


class WrittenFrames:
    """Sums over the frames of a clip of `count` frames, one after another."""

    def __init__(self, count: int) -> None:
        self.masks, self.view, self.medians = MaskEvidence(), FieldOfView(), []
        self.still, self.planes, self.frames = StillParts(count), ColourPlanes(count), 0
        self.blended: list[float] = []
        self.order, self.turns, self.held, self.late = MaskOrder(), MaskTurns(), HeldMasks(), LateParts()
        self.specks, self.pairs, self.displaced = Specks(), PairViews(count), DisplacedDepth(count)
        self.depths = DepthTurns(), DepthSteps(count)

    def add(self, pair: PicturePair, tissue: BoolArray | None, depth: NDArray[np.float32] | None) -> None:
        """One frame: pictures (H, W, 3), tissue (H, W) or None without masks, depth (H, W) or None, 0 = missing."""
        picture, (turns, steps) = pair.left, self.depths
        self.pairs.add(self.frames, picture, pair.right)
        self.specks.add(self.frames, tissue)
        turns.add(self.frames, depth)
        steps.add(self.frames, picture, depth, tissue)
        self.view.add(picture, tissue)
        self.still.add(self.frames, picture, tissue)
        self.planes.add(self.frames, picture)
        self.frames += 1
        self.order.add(tissue)
        self.turns.add(tissue)
        self.held.add(tissue)
        self.late.add(picture, tissue, depth)
        self.displaced.add(self.frames - 1, tissue, depth)
        if tissue is not None:
            self.masks.add(picture, tissue, depth)
        if depth is not None and depth.any():
            self.medians.append(float(np.median(depth[depth > 0])))
            self.blended.append(blended_rim(depth))

    def notes(self, clip: Clip, border: Border) -> list[str]:
        """Sentences on the frames of this clip, warnings where they contradict what was stated.

        border   what happens with a dark border; a warning only where the masks of the clip are kept as they are
        """
        where, notes = str(clip.where), []
        if clip.masks is not None:
            excluded = clip.masks.excluded_value
            against = self.masks.flip_findings(where) or self.masks.findings(where, excluded)
            notes += notes_of(against) or [self.masks.note(excluded)]
            parts = self.turns, self.order, self.held, self.specks
            notes += notes_of([found for part in parts for found in part.findings(where)])
            notes += notes_of(self.late.findings(where, where) or self.displaced.findings(where))
            notes += notes_of(border_findings(self.view, where)) if border == "auto" else []
        notes += notes_of([found for part in self.depths for found in part.findings(where)])
        notes += notes_of(self.pairs.findings([Path(where) / name for name in clip.names]))
        notes += notes_of(self.still.findings(where) + self.planes.findings(where) + rim_finding(self.blended, where))
        return notes + self._depth_notes(clip)

    def _depth_notes(self, clip: Clip) -> list[str]:
        if clip.depth is None or clip.depth.stated is None or clip.arbitrary or not self.medians:
            return []
        usual = float(np.median(self.medians))
        apart = "near" if usual < NEAR else "far" if usual > FAR else ""
        remedy = f"; if that is too {apart}, state --depth-unit or --depth-scale" if apart else ""
        remedy += " (0.2 for 5000 steps a metre)" if apart == "far" else ""
        return [f"{clip.depth.stated.name}: the median depth is {usual:.4g} mm{remedy}"]
