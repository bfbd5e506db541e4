"""Table of equation (7) on one checkpoint, over the D-SSIM weight and the up-sampling rule.

python docs/make.py full_size.calibrate RUN     writes docs/results/calibration.json and prints the table
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

WEIGHTS = (0.0, 0.05, 0.1, 0.2)
RULES = ("co_sited", "half_pixel")


def cell(run: Path, weight: float, rule: str) -> dict:
    """What `endotsr train --calibrate-only` finds with this weight and rule."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.json"
        words = [
            "train",
            "--calibrate-only",
            "--out",
            str(run),
            "--loss.ssim-weight",
            str(weight),
            "--loss.upsampling",
            rule,
            "--json",
            str(out),
        ]
        subprocess.run([sys.executable, "-m", "endotsr.cli.main", *words], check=True, stdout=subprocess.DEVNULL)
        found = json.loads(out.read_text(encoding="utf-8"))
    return {
        "ssim_weight": weight,
        "upsampling": rule,
        "lambda_lap": found["lambda_lap"],
        "iteration": found["iteration"],
    }


def main(words: list[str]) -> None:
    """The command."""
    if len(words) != 1:
        sys.exit(__doc__)
    cells = [cell(Path(words[0]), weight, rule) for rule in RULES for weight in WEIGHTS]
    target = Path(__file__).parents[2] / "results" / "calibration.json"
    target.write_text(json.dumps({"cells": cells}, indent=2) + "\n", encoding="utf-8")
    print("| up-sampling | " + " | ".join(f"w = {w:g}" for w in WEIGHTS) + " |\n" + "|---" * (len(WEIGHTS) + 1) + "|")
    for rule in RULES:
        row = [f"{c['lambda_lap']:.3f}" for c in cells if c["upsampling"] == rule]
        print(f"| `{rule}` | " + " | ".join(row) + " |")
