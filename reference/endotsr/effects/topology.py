"""Change of topology, as by cutting: tissue that appears or vanishes and that no motion of the reference explains.

After the frames are moved onto the reference along their flow, a difference of local structure that stays (in a sixth
of the frames or more) marks tissue that the reference does not show, or shows and has lost. A tile counts when the
correlation of its local structure with the reference falls below `LOST`, while it is textured enough to correlate.
This is the least certain of the tests: a strong highlight that wanders, or flow that fails, gives the same picture.
"""

import numpy as np

from endotsr.effects.clip import TILE, Clip, tile_map, tile_means
from endotsr.effects.noise import Noise
from endotsr.effects.tracks import Tracks, normalised
from endotsr.effects.verdict import Curve, Map, Verdict

LOST = 0.3  # correlation below which a tile no longer shows the tissue of the reference
TEXTURED = 0.8  # least correlation that a tile must reach in its best tenth of the frames
STAYS = 1.0 / 6.0  # fraction of the frames
TILE_FRACTION = 0.02
LEAST_TILES = 2


def topology_verdict(clip: Clip, tracks: Tracks, noise: Noise) -> Verdict:
    """Whether tissue of the reference is lost for good."""
    scores = structure_scores(clip, tracks, noise)
    known = np.isfinite(scores)
    best = np.nanpercentile(np.where(known, scores, -1.0), 90, axis=0)
    textured = (best > TEXTURED) & tracks.usable
    lost = known & (scores < LOST)
    fraction = lost.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    gone = textured & (fraction >= STAYS)
    needed = max(LEAST_TILES, TILE_FRACTION * int(textured.sum()))
    statistic = float(gone.sum()) / needed
    present = statistic >= 1.0
    reason = (
        f"In {int(gone.sum())} of {int(textured.sum())} tiles the structure of the reference is lost and stays lost."
        if present
        else "The structure of the reference frame is found again in every frame that shows the place."
    )
    course = (lost & textured).sum(axis=1) / max(int(textured.sum()), 1)
    return Verdict("topology change", present, "suspected" if present else "none", statistic, 1.0,
                   "times the threshold", "tiles that lose their structure in a sixth of the frames, over 2 %",
                   0.05, reason, {"tiles": int(gone.sum())},
                   Curve("tiles without the structure of the reference, percent", "time", clip.times,
                         {"lost": 100 * course}),
                   Map("structure lost, percent of the frames",
                       tile_map(np.where(textured, 100 * fraction, np.nan), *clip.images.shape[2:])))  # fmt: skip


def structure_scores(clip: Clip, tracks: Tracks, noise: Noise) -> np.ndarray:
    """Correlation (m, T) of the local structure of the aligned frames with that of the reference; nan if not seen."""
    sigma, reference = float(noise.working.mean()), clip.reference
    grey = np.einsum("c,mchw->mhw", np.array([0.299, 0.587, 0.114], np.float32), tracks.aligned)
    rows = []
    for k in range(clip.count):
        common = tracks.valid[k]
        a = normalised(grey[reference], common, sigma).astype(np.float32) - 128
        b = normalised(grey[k], common, sigma).astype(np.float32) - 128
        (ab, aa, bb), count = tile_means(np.stack([a * b, a * a, b * b]), common)
        with np.errstate(all="ignore"):
            rows.append(np.where(count >= 0.9 * TILE * TILE, ab / np.sqrt(aa * bb), np.nan))
    return np.array(rows)
