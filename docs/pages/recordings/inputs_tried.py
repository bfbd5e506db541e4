"""Run the inputs of `tests/clips/sequences/inputs_tried.py`; write the table of those that were read wrongly before.

    python docs/make.py recordings.inputs_tried
    python docs/make.py recordings.inputs_tried --table     rewrite the table of the last result

`BEFORE` says what happened to an input on an earlier revision, and which row stands for it. What happens now is run.
The result is docs/results/inputs_tried.json; the table is in docs/guides/prepare.md.
"""

import argparse
import sys
import tempfile
from collections import Counter
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "inputs_tried.json", DOCS / "guides" / "prepare.md"
ROWS = DOCS.parent / "tests" / "clips" / "sequences"
LONGEST = 160  # characters of a message


class Before(NamedTuple):
    """An input on an earlier revision."""

    kind: str  # of the row
    verdict: str  # silent, wrong reason, refused
    what: str  # what happened


REPORTED = [  # inputs after public reports, on revision 8836043f
    Before("LLFF, axes of its own tool, training", "silent", "trained with other axes"),
    Before("COLMAP, two models, the first is the small one", "silent", "the small model was read"),
    Before("calibration, rostopic echo, fisheye", "silent", "k1 to k4 were applied as k1 k2 p1 p2"),
    Before("calibration, with --distortion", "silent", "the coefficients were ignored"),
    Before("trajectory of EuRoC, w x y z by a head line without a mark", "silent", "read as x y z w"),
    Before("video, every picture twice, coded", "silent", "a held-out frame had its copy in the training"),
    Before("trajectory, the wrong direction", "silent", "trained with inverse poses"),
    Before("video, lead-in hidden by an edit list", "wrong reason", "refused as truncated or damaged"),
    Before("depth, points x y z of SCARED", "wrong reason", "refused as a damaged TIFF"),
    Before("nerfstudio, separators of Windows", "refused", "a name with folders"),
    Before("Blender, transforms_train.json", "refused", "no known layout"),
    Before("calibration, rostopic echo with roi and several messages", "refused", "not YAML"),
    Before("calibration, settings of ORB-SLAM", "refused", "no known calibration"),
    Before("trajectory of KITTI", "refused", "8 numbers expected"),
    Before("depth, one npz for the clip", "refused", "a file of another kind"),
    Before("stereo, two videos in a folder", "refused", "no known layout"),
    Before("video of a recorder, .VOB", "refused", "no known layout"),
]
FOUND = [  # inputs made up later, on revision 9c72cc4f
    Before(
        "trajectory, the quaternion before the position by the head line", "silent", "position and rotation exchanged"
    ),
    Before("trajectory in nanoseconds, two poses a frame", "silent", "every frame had the first pose"),
    Before("trajectory, transposed 4x4 matrices", "silent", "positions were dropped"),
    Before("nerfstudio, transposed matrices", "silent", "positions were dropped"),
    Before("COLMAP, images.txt without lines of points", "silent", "every second picture was dropped"),
    Before("COLMAP, a text model and a binary model in one folder", "silent", "one was read"),
    Before("COLMAP, bytes behind the last entry of images.bin", "silent", "the rest was ignored"),
    Before("COLMAP, masks beside it", "silent", "instruments counted as tissue"),
    Before("points, x y z behind the colours", "silent", "colours were read as positions"),
    Before("points, faces behind the vertices", "silent", "faces were read as points"),
    Before("points, the file is not there", "silent", "no points"),
    Before("points, little-endian", "refused", "ASCII expected"),
    Before("calibration, K and D with 4 coefficients", "silent", "no word on the order"),
    Before("pictures, PNG turned by EXIF", "silent", "read as stored"),
    Before("pictures, PNG of high dynamic range", "silent", "read as sRGB"),
    Before("pictures, PNG of a stereo pair", "silent", "read as one view"),
    Before("pictures, PNG with other primaries", "silent", "read as sRGB"),
    Before("pictures, PNG with oblong pixels", "silent", "read as square"),
    Before("pictures, several in a JPEG", "silent", "the first was read"),
    Before("pictures, Adobe RGB by EXIF", "silent", "read as sRGB"),
    Before("pictures, others of a kind that is not read", "silent", "left out"),
    Before("pictures beside masks, depth, times and a calibration", "silent", "not read"),
    Before("EndoNeRF, masks in gt_masks alone", "silent", "no masks"),
    Before("EndoNeRF, a second pose file", "silent", "one was read"),
    Before("nerfstudio, depth and masks that the file does not name", "silent", "not read"),
    Before("depth, TIFF with a number that means none", "silent", "the number was read as a depth"),
    Before("disparity times 256", "silent", "depth was divided by 256"),
    Before("depth, one npz for each frame", "refused", "no file of a known kind"),
    Before("video, side by side by a mark of H.264", "silent", "read as one view"),
    Before("video, stacked by a mark of H.264", "silent", "read as one view"),
    Before("video, a crop of Matroska", "silent", "read without the crop"),
    Before("video, mirrored", "wrong reason", "refused as turned by half"),
    Before("video, AVI with pictures that refer to later ones", "silent", "another frame rate was written"),
    Before("pictures named by their seconds", "silent", "read as evenly spaced"),
    Before("COLMAP, points that points3D lacks", "silent", "left out"),
    Before("nerfstudio, pictures that the file does not list", "silent", "left out"),
    Before("TUM, trajectory and settings of ORB-SLAM", "silent", "a still camera"),
    Before("trajectory of EuRoC with seventeen columns", "refused", "8 numbers expected"),
]
REST = [  # folders and files of other programs and data sets, on revision badb3e51
    Before("EuRoC, mav0/ with one camera and the ground truth", "refused", "no known layout"),
    Before("times, times.txt of KITTI", "refused", "no known layout"),
    Before("names in seconds and a trajectory that begins later", "silent", "poses three frames early"),
    Before("TUM, a picture without a line", "silent", "left out"),
    Before("calibration, cameraParameters of MATLAB as a struct", "refused", "no known calibration"),
    Before("depth, one MAT-file for each frame", "refused", "no file of a known kind"),
    Before("stereo, views squeezed to half their width", "silent", "read with half the width"),
    Before("stereo, squeezed views in pictures", "silent", "read with half the width"),
    Before("SCARED, the file of a frame is missing", "silent", "later poses one frame early"),
    Before("SCARED, a file of no frame", "silent", "left out"),
    Before("SCARED, a calibration in every frame", "silent", "not read"),
    Before("SERV-CT, P1 and P2 differ", "silent", "the right camera was ignored"),
    Before("Hamlyn, two folders of left pictures", "silent", "one was read"),
    Before("pictures, bmp with oblong pixels", "silent", "read as square"),
    Before("video, AVI meant for a part of a window", "silent", "the window was ignored"),
    Before("video, a scrambled transport stream", "silent", "the mark was ignored"),
    Before("video, a transport stream with a second view", "silent", "one view was read"),
    Before("video, a scrambled DVD", "silent", "the mark was ignored"),
    Before("common format, further files, check", "silent", "not named"),
    Before("common format, masks that sequence.toml does not state, check", "silent", "not named"),
    Before("common format, further files, inspect", "silent", "not named"),
]
CARELESS = [  # folders of a careless user, on revision b0dcc5c9
    Before("masks, numbers of objects, one of them small", "silent", "an instrument counted as tissue"),
    Before("common format, a small object of another number in the masks", "silent", "an instrument counted as tissue"),
    Before("nerfstudio, applied_scale and depth", "silent", "depth was not multiplied by it"),
    Before("TUM, associations", "silent", "not named"),
]
STRANGER = [  # masks, folders and mistakes of users who know no convention, on revision 5e0f551e
    Before("masks, noise of a codec in frames without an instrument", "refused", "26 values: no mask"),
    Before("masks, dark jpg in frames without an instrument", "refused", "39 values: no mask"),
    Before("masks, two small numbers in a frame without an instrument", "refused", "26 values: no mask"),
    Before("masks, a video", "refused", "a file of another kind"),
    Before("masks, jpg, --excluded-value nonzero", "silent", "noise was excluded"),
    Before("masks, inverted, in prepare", "silent", "tissue was excluded"),
    Before("pictures, letterbox", "silent", "black bars counted as tissue"),
    Before("pictures of two cameras by their last number", "silent", "two cameras as one"),
    Before("depth, negative", "silent", "no depth was written"),
    Before("depth, centimetres", "silent", "read as millimetres"),
    Before("calibration, ROS, the right camera alone", "silent", "read as one camera"),
    Before("trajectory whose stamps go back", "silent", "sorted"),
    Before("trajectory, matrices in brackets", "refused", "8 numbers expected"),
    Before("trajectory with decimal commas", "wrong reason", "8 numbers expected"),
    Before("calibration, calib_cam_to_cam.txt of KITTI", "refused", "no camera matrix"),
    Before("calibration, calib.txt of KITTI, one camera", "refused", "no camera matrix"),
    Before("calibration, P1 and P2 of OpenCV", "refused", "no known calibration"),
    Before("calibration, matrix K as csv", "refused", "no known calibration"),
    Before("calibration that is not there", "wrong reason", "no known calibration"),
    Before("EndoNeRF, a negative focal length", "wrong reason", "unknown intrinsics"),
    Before("depth, half-float TIFF", "wrong reason", "a damaged TIFF"),
]


def measured() -> dict[str, Any]:
    """The outcome of every row of `inputs_tried.py`, run now."""
    sys.path.insert(0, str(ROWS))
    inputs_tried: Any = import_module("inputs_tried")  # of the tests; this module is `pages.recordings.inputs_tried`
    found = {}
    for row in inputs_tried.ROWS:
        with tempfile.TemporaryDirectory() as scratch:
            one = inputs_tried.tried(row, Path(scratch))
        message = " ".join(one.message.replace("|", "/").replace("<", "").split())
        found[row.kind] = {"outcome": one.outcome, "message": message if one.outcome != "right" else ""}
        print(f"{one.outcome:>18}  {row.kind}", flush=True)
    return {"date": date.today().isoformat(), "rows": found}


def table(result: dict[str, Any]) -> str:
    """Before and now, and the number of all inputs by their outcome."""
    parts = []
    tables = {
        "After public reports": REPORTED,
        "Made up later": FOUND,
        "Other folders": REST,
        "Careless": CARELESS,
        "Strangers": STRANGER,
    }
    for title, entries in tables.items():
        rows = []
        for one in entries:
            now = result["rows"][one.kind]
            said = f"`{now['message'][:LONGEST]}`" if now["message"] else ""
            rows.append([one.kind, f"{one.verdict}: {one.what}", now["outcome"], said])
        parts.append(markdown((title, "Before", "Now", "Message"), rows))
    counts = Counter(row["outcome"] for row in result["rows"].values())
    total = ", ".join(f"{outcome} {count}" for outcome, count in sorted(counts.items()))
    silent = counts.get("WRONG IN SILENCE", 0)
    parts.append(f"All {counts.total()} inputs: {total}; wrong in silence {silent}; {result['date']}.")
    return "\n\n".join(parts)


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--table", action="store_true")
    if not parser.parse_args(words).table:
        write_json(FILE, measured())
    found = read_json(FILE, "docs/pages/recordings/inputs_tried.py")
    write_marked(PAGE, {"table": table(found)}, "inputs_tried")
