"""Detection of flipped or mirrored depth by the light: clips as stored, and their flips.

python docs/make.py recordings.flips CLIP ...      sequence folders; writes the table in docs/guides/depth.md
"""

from pathlib import Path

import numpy as np

from endotsr.clips.sequences.checks.flips import FLIPS, shading_finding, shading_fit
from endotsr.clips.sequences.checks.frame_pass import SAMPLED
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import PAPER
from endotsr.results.report.tables import markdown
from pages.store.marks import write_marked

PAGE = Path(__file__).parents[2] / "guides" / "depth.md"


def row(folder: Path) -> list[str]:
    """Name, frames, the fits of the depth as stored and flipped, and the findings for each."""
    clip = read_sequence(folder, PAPER.sequence, PAPER.raster.near)
    frames = np.unique(np.linspace(0, clip.count - 1, min(SAMPLED, clip.count)).astype(int))
    stored, named = {}, 0
    for name, axes in {"": (), **FLIPS}.items():
        made = [
            shading_fit(clip.images[i].transpose(1, 2, 0), np.flip(clip.depth[i], axes), clip.masks[i]) for i in frames
        ]
        fits = [fit for fit in made if fit is not None]
        found = shading_finding(fits, "")
        named += bool(name and found and f"light {name} (" in found[0].what)
        if not name:
            stored = {"as stored": np.median([fit.stored for fit in fits]), "said": len(found)}
            stored["flipped"] = np.median([fit.flipped for fit in fits], axis=0).max()
    cells = [folder.name, f"{len(frames)}", f"{stored['as stored']:.2f}", f"{stored['flipped']:.2f}"]
    return [*cells, "yes" if stored["said"] else "no", f"{named} of {len(FLIPS)}"]


def main(words: list[str]) -> None:
    """The command."""
    headings = ["Clip", "Frames", "As stored", "Best flip of it", "False alarm", "Flips that are named"]
    write_marked(PAGE, {"table": markdown(headings, [row(Path(word)) for word in words])}, "flips")
