"""`sharp` on EndoNeRF cutting with the outliers of its prior depth kept and removed: a table of the rulings.

In: docs/results/outliers_kept_seed?.json, recorded at revision 21e07a9c, whose `sharp` kept them (today
`--sequence.depth-outliers kept`), and docs/results/outliers_removed_seed?.json, recorded at b6d47884. The two frames
named are the held-out neighbours of the training frames with outliers, 74 and 146.
"""

from endotsr.results.report.tables import markdown
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program

RULES = {"kept": "outliers_kept_seed?.json", "removed": "outliers_removed_seed?.json"}
BESIDE = (73, 145)
HEAD = ("outliers", "seed", "PSNR, dB", "LPIPS [0,1]", *(f"frame {frame}, dB" for frame in BESIDE))


def runs(rule: str) -> list[dict]:
    """The recorded runs, by seed."""
    return [loaded(file) for file in sorted(RESULTS.glob(RULES[rule]))]


def frame_psnr(run: dict, frame: int) -> float:
    """PSNR of the whole picture of a held-out frame, dB."""
    return next(row["psnr_full"] for row in run["held_out"]["per_frame"] if row["frame"] == frame)


def table() -> str:
    """One row per run."""
    rows = [
        [
            rule,
            str(run["run"]["seed"]),
            f"{run['held_out']['mean']['psnr_full']:.2f}",
            f"{run['held_out']['mean']['lpips']:.4f}",
            *(f"{frame_psnr(run, frame):.2f}" for frame in BESIDE),
        ]
        for rule in RULES
        for run in runs(rule)
    ]
    return markdown(HEAD, rows)


PROGRAM = Program(__name__, "specification/rulings.md", {"outliers": table}, room="depth")
