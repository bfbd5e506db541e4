"""Write the generated parts of docs/claims.md, docs/guides/sweep.md and the answer of README.md and docs/paper.md.

The differences are recomputed from the stored runs each time, and written to the file of the ablation.

To measure, on an otherwise idle machine (each command continues where it was interrupted):

    endotsr ablate ../shared/data/endonerf_pulling --out runs/ablation_pulling --lpips LPIPS.npz \
        --json docs/results/ablation_pulling.json
    endotsr ablate ../shared/data/endonerf_cutting --out runs/ablation_cutting --lpips LPIPS.npz \
        --json docs/results/ablation_cutting.json
    endotsr ablate ../shared/data/endonerf_pulling --out runs/ablation_half --lpips LPIPS.npz --scale 0.5 \
        --iterations 1750 --splits every_second --configurations base A+S+L --no-fixed-count \
        --json docs/results/ablation_pulling_half.json
    endotsr prepare ../shared/data/endonerf_pulling --out runs/pulling_pairs --right-late -1
    endotsr ablate runs/pulling_pairs --out runs/ablation_pairs --lpips LPIPS.npz --scale 0.5 \
        --iterations 1750 --splits every_second --configurations base A+S+L --no-fixed-count \
        --measures right_view --json docs/results/ablation_pulling_pairs.json
    endotsr ablate ../shared/data/endonerf_pulling --out runs/ablation_blocks --lpips LPIPS.npz --scale 0.5 \
        --iterations 1750 --splits "blocks 2" "end 8" --configurations base A+S+L --no-fixed-count \
        --json docs/results/ablation_pulling_half_blocks.json
    endotsr ablate ../shared/data/endonerf_pulling --out runs/ablation_fixed --lpips LPIPS.npz --scale 0.5 \
        --iterations 1750 --configurations A+S A+S+L --json docs/results/ablation_pulling_half_fixed.json
    endotsr ablate ../shared/data/endonerf_pulling --out runs/ablation_pulling --collect --json ...   what is finished
    endotsr ablate simulated --preset demo --out runs/ablation_simulated --json docs/results/ablation_simulated.json
    endotsr ablate simulated --preset paper --iterations 1500 --no-fixed-count --out runs/ablation_simulated_paper \
        --configurations base A S L A+S A+S+L --json docs/results/ablation_simulated_paper.json

A missing result is shown as "not measured yet"; a result of some seeds is shown with their number.
"""

from pathlib import Path
from typing import Any

from endotsr.studies.sweeps.ablation_page import ablation_record, draw
from endotsr.studies.sweeps.execute import FINISHED
from endotsr.studies.sweeps.results import METRICS
from endotsr.training.runs.files import write_json
from pages.claims import answer as claims_answer
from pages.claims import parts as claims_parts
from pages.claims import power as claims_power
from pages.claims import protocols as claims_protocols
from pages.claims import verdicts as claims_verdicts
from pages.store.commands import loaded
from pages.store.marks import read_json
from pages.store.program import RESULTS, Program

FILES = {
    "pulling": "ablation_pulling.json",
    "cutting": "ablation_cutting.json",
    "pulling_half": "ablation_pulling_half.json",
    "pulling_half_blocks": "ablation_pulling_half_blocks.json",
    "pulling_half_fixed": "ablation_pulling_half_fixed.json",
    "pulling_pairs": "ablation_pulling_pairs.json",
    "simulated": "ablation_simulated.json",
    "simulated_paper": "ablation_simulated_paper.json",
}
UNSEEN = 73  # test frame of cutting with a region that no training frame shows
PICTURE = "![Differences between configurations on cutting with their intervals](results/ablation_cutting.svg)\n\n"
NO_FRAMES = "The metrics of single frames are not recorded in these runs (`endotsr ablate --collect` records them)."
COST = "sweep_cost.json"  # by docs/pages/claims/sweep_cost.py
RUNS = "pulling*.json"  # records of single runs, by docs/pages/full_size/record.py
CUTTING = "cutting*.json"  # of the other clip


def read(folder: Path) -> dict[str, Any]:
    """The ablations by name; None if there is no result yet. Raises: InputError for an unreadable file."""
    found = {name: folder / file for name, file in FILES.items()}
    return {
        name: compared(read_json(path, "endotsr ablate")) if path.exists() else None for name, path in found.items()
    }


def compared(record: Any) -> Any:
    """The record of an ablation with the differences listed in `COMPARISONS`."""
    rows: Any = [{**row, "status": FINISHED} for row in record["rows"]]
    again = ablation_record(rows, record["command"], unrecorded=True)
    return {**record, **{key: again[key] for key in ("format", "levels", "increments")}}


def without_frames(record: Any, left_out: set[int]) -> Any:
    """The record with means over the other held-out frames; None if the metrics of the frames are not recorded."""
    if record is None or not all(row.get("per_frame") for row in record["rows"]):
        return None
    rows = []
    for row in record["rows"]:
        frames = [frame for frame in row["per_frame"] if frame["frame"] not in left_out]
        of = {metric: [f[metric] for f in frames if f.get(metric) is not None] for metric in METRICS}
        rows.append({**row, **{metric: sum(v) / len(v) if v else None for metric, v in of.items()}})
    return compared({**record, "rows": rows})


def read_runs(folder: Path, name: str = RUNS) -> list[dict[str, Any]]:
    """The records of single runs in the same folder."""
    return [loaded(path) for path in sorted(folder.glob(name))]


def parts(folder: Path = RESULTS) -> dict[str, str]:
    """Every generated part of both pages by name."""
    found, runs, cost = read(folder), read_runs(folder), folder / COST
    gain = claims_protocols.gain_of_the_right_eye(found["pulling_pairs"])
    half = [found[name] for name in FILES if name.startswith("pulling_half")]
    return {
        **{f"verdicts_{clip}": claims_verdicts.verdicts(found[clip], clip) for clip in claims_verdicts.CLIPS},
        "verdicts_both": claims_verdicts.verdicts_of_both(found),
        "cutting_without": without_73(found["cutting"]),
        "ours": claims_protocols.ours(found, half, found["pulling_pairs"]),
        "visits": claims_protocols.visits(half),
        "answer": claims_answer.answer(folder, found_clips(found), [*half, found["pulling_pairs"]], gain),
        "spread": " ".join(claims_power.common_spread(found[clip], clip) for clip in claims_verdicts.CLIPS),
        "right_eye": claims_protocols.right_eye(found["pulling_pairs"]),
        "power": claims_power.sentences(found["pulling"], "EndoNeRF pulling"),
        **{name: claims_parts.tables(record) for name, record in found.items()},
        "cutting": (PICTURE if found["cutting"] else "") + claims_parts.tables(found["cutting"]),
        "protocols": claims_parts.protocols(
            [found["pulling"], found["cutting"], *half, found["pulling_pairs"]], [*runs, *read_runs(folder, CUTTING)]
        ),
        "cost": claims_parts.cost(found["pulling"], runs),
        "divided": claims_parts.divided(loaded(cost) if cost.exists() else None),
    }


def found_clips(found: dict[str, Any]) -> dict[str, Any]:
    """The ablations of the two clips of the paper."""
    return {clip: found[clip] for clip in claims_verdicts.CLIPS}


def without_73(cutting: Any) -> str:
    """The verdicts on cutting without the test frame that shows a region of no training frame."""
    if cutting is None:
        return claims_verdicts.NOT_YET
    found = without_frames(cutting, {UNSEEN})
    return NO_FRAMES if found is None else claims_verdicts.verdicts(found, "cutting")


def draw_ablations(folder: Path) -> None:
    """Write the differences of every ablation to its file NAME.json, and a figure of their intervals to NAME.svg."""
    for name, found in read(folder).items():
        if found is not None and found["increments"]:
            write_json(folder / FILES[name], found)
            draw(found, (folder / FILES[name]).with_suffix(".svg"))


PROGRAM = Program(
    __name__, ("claims.md", "guides/sweep.md", "paper.md", "../README.md"), parts,
    draw=lambda record: draw_ablations(RESULTS),
)  # fmt: skip
