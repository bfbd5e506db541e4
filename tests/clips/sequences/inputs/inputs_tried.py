"""Inputs as users have them, made up with real codecs, and what each command does with them.

    python tests/clips/sequences/inputs/inputs_tried.py            the table in Markdown
    python tests/clips/sequences/inputs/inputs_tried.py WORD       the rows whose kind holds the word

An outcome is `right` (the numbers that were written are those of the input), `told` (right, and a printed line names
what was done or assumed), `refused` (exit code 1 or 2 and one line), or `WRONG IN SILENCE`. `test_inputs_tried.py`
asserts every row.

The rows lie in the file of their subject, `picture_inputs.py` to `command_inputs.py`: one about masks of a video in
that of masks, one about a public layout in `dataset_inputs.py`. What several files make is in
`input_kinds.py`, and what checks an outcome in `input_rows.py`.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[3]))
from calibration_inputs import CALIBRATION_ROWS
from command_inputs import COMMAND_ROWS
from dataset_inputs import DATASET_ROWS
from depth_inputs import DEPTH_ROWS
from input_rows import Outcome, Row
from mask_inputs import MASK_ROWS
from model_inputs import MODEL_ROWS
from picture_inputs import PICTURE_ROWS
from pose_inputs import POSE_ROWS
from stereo_inputs import STEREO_ROWS
from time_inputs import TIME_ROWS
from video_inputs import VIDEO_ROWS

from endotsr.cli.main import main

WRONG = "WRONG IN SILENCE"
LONGEST = 200  # characters of a message in the table
NOT_HERE = {  # codecs that no package here encodes, so that no recording of them can be made
    "H.264 in separate field pictures (PAFF)": "the encoder x264 writes adaptive fields alone",
    "DV and DVCPRO": "their encoders take broadcast sizes alone",
    "DICOM and endoscope formats of a vendor": "no open encoder",
}
ROWS = [
    *PICTURE_ROWS,
    *VIDEO_ROWS,
    *STEREO_ROWS,
    *CALIBRATION_ROWS,
    *DEPTH_ROWS,
    *MASK_ROWS,
    *POSE_ROWS,
    *TIME_ROWS,
    *MODEL_ROWS,
    *DATASET_ROWS,
    *COMMAND_ROWS,
]


def tried(row: Row, folder: Path) -> Outcome:
    """Make the input in an empty folder, run the command, and compare with what was expected."""
    words = row.make(folder)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    printed = out.getvalue() + err.getvalue()
    lines = [line.strip() for line in printed.replace(str(folder) + "/", "").splitlines() if line.strip()]
    named = next((line for line in lines if row.said and row.said in line), "")
    silent = row.expected == "refused" or (row.expected == "told" and not named)
    outcome = "refused" if code else WRONG if silent or not row.check(folder) else row.expected
    command = " ".join(["endotsr", *(word.replace(str(folder) + "/", "") for word in words)])
    return Outcome(row, command, outcome, named or (lines[-1] if lines else ""))


def table(word: str = "") -> str:
    """The rows whose kind holds the word, as Markdown."""
    lines, counts = ["| Input | Command | Outcome | Message |", "|---|---|---|---|"], {}
    for row in ROWS:
        if word in row.kind:
            with tempfile.TemporaryDirectory() as scratch:
                found = tried(row, Path(scratch))
            counts[found.outcome] = counts.get(found.outcome, 0) + 1
            message = found.message.replace("|", "/")[:LONGEST] if found.outcome != "right" else ""
            lines.append(f"| {row.kind} | `{found.command}` | {found.outcome} | {message} |")
    lines += [f"| {kind} | - | not tried | {why} |" for kind, why in NOT_HERE.items() if word in kind]
    total = ", ".join(f"{outcome}: {count}" for outcome, count in sorted(counts.items()))
    return "\n".join(
        [*lines, "", f"{sum(counts.values())} inputs; {total}; wrong in silence: {counts.get('WRONG IN SILENCE', 0)}"]
    )


if __name__ == "__main__":
    print(table(*sys.argv[1:2]))
