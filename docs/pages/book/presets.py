"""The table of docs/guides/which_preset.md from stored runs: python docs/make.py book.presets"""

import sys
from pathlib import Path

import numpy as np

from endotsr.errors import InputError
from endotsr.results.report.tables import markdown
from pages.book import readme_presets, running_clip
from pages.full_size.text import LABELS, PREDICTIONS
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, MINUTES = DOCS / "guides" / "which_preset.md", DOCS / "results" / "minutes.json"
FULL_SIZE = DOCS / "results" / "full_size" / "runs.json"
COMMAND = "docs/pages/book/presets.py"


def recorded() -> str:
    """Time, memory and quality of each preset on the recorded clip: the table of README.md with the sizes."""
    return readme_presets.table(read_json(MINUTES, COMMAND), (*readme_presets.SIZES, *readme_presets.MEASURED))


def simulated() -> str:
    """PSNR of the presets that were trained on the simulated clip, and of what needs no model."""
    seeds = running_clip.means(read_json(running_clip.FILE, running_clip.COMMAND))
    squares = [row["squared_error"]["model"] for row in read_json(FULL_SIZE, COMMAND)["paper_eighth"]["frames"]]
    paper = np.mean(-10 * np.log10(squares))
    model = seeds["model"]
    rows = [["`quick`", f"{model.mean():.2f}", f"{model.size}"], ["`paper`", f"{paper:.2f}", "1"]]
    rows += [[LABELS[name], f"{seeds[name].mean():.2f}", "-"] for name in PREDICTIONS[1:]]
    return markdown(("Prediction", "PSNR tissue, dB", "Seeds"), rows)


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    try:
        write_marked(PAGE, {"recorded": recorded(), "simulated": simulated()}, "presets")
    except InputError as error:
        sys.exit(f"error: {error}")
