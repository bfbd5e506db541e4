"""What `endotsr prepare` sees of the frames that it writes: the share of tissue, dark borders, the usual depth."""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.choices import Border
from endotsr.clips.sequences.checks.colour_planes import ColourPlanes
from endotsr.clips.sequences.checks.dark_border import border_findings
from endotsr.clips.sequences.checks.depth import rim_finding
from endotsr.clips.sequences.checks.depth_rims import blended_rim
from endotsr.clips.sequences.checks.exchanged import MaskOrder
from endotsr.clips.sequences.checks.guard import notes_of
from endotsr.clips.sequences.checks.held import HeldMasks
from endotsr.clips.sequences.checks.late import LateParts
from endotsr.clips.sequences.checks.masks import MaskTurns
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.checks.still_parts import StillParts
from endotsr.clips.sequences.clip import Clip
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

    def add(self, picture: NDArray[np.uint8], tissue: BoolArray | None, depth: NDArray[np.float32] | None) -> None:
        """One frame: picture (H, W, 3), tissue (H, W) or None without masks, depth (H, W) or None, 0 = missing."""
        self.view.add(picture, tissue)
        self.still.add(self.frames, picture, tissue)
        self.planes.add(self.frames, picture)
        self.frames += 1
        self.order.add(tissue)
        self.turns.add(tissue)
        self.held.add(tissue)
        self.late.add(picture, tissue, depth)
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
            notes += notes_of([*self.turns.findings(where), *self.order.findings(where), *self.held.findings(where)])
            notes += notes_of(self.late.findings(where, where))
            notes += notes_of(border_findings(self.view, where)) if border == "auto" else []
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
