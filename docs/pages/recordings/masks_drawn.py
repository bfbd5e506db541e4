"""Masks that were drawn by eye on the page, carried to a whole simulated clip: the table of docs/guides/masks.md.

    python docs/make.py recordings.masks_drawn           carry and measure, a minute
    python docs/make.py recordings.masks_drawn --table   rewrite the table of the last result

The polygons of docs/results/masks_drawn_keys.json were set from the pictures of the page alone: five frames of the
first page, then the three frames that the second page added. Nobody was timed with a mouse: the minutes follow from a
pace that is stated in the table, with which the corners were clicked in the page of a browser. The result is
docs/results/masks_drawn.json.
"""

import argparse
import time
from datetime import date
from typing import Any

import msgspec

from endotsr.clips.sequences.carry_masks import carry_masks
from endotsr.clips.sequences.clip_flows import motion_of
from endotsr.clips.sequences.drawn_masks import DrawnFile, key_masks
from endotsr.clips.sequences.splits import even_frames
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import with_settings
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.masks_keys import DOCS, MARGIN, PAGE, SIZE, quality
from pages.store.marks import read_json, write_marked

FILE, DRAWN = DOCS / "results/masks_drawn.json", DOCS / "results/masks_drawn_keys.json"
CORNER, LOOK = 1.2, 4.0  # seconds for a corner, and for a look at a frame before its first corner
FIRST = 5  # frames of the first page, evenly spaced


def drawn() -> DrawnFile:
    """The polygons, as the page saved them."""
    return msgspec.json.decode(DRAWN.read_bytes(), type=DrawnFile)


def measured() -> dict[str, Any]:
    """The record: corners, quality against the instrument that the picture shows, and seconds of computing."""
    frames = list(simulated_frames(make_scene(with_settings(named_scene("cutting"), **SIZE))))
    pictures, truth = [frame.image.transpose(1, 2, 0) for frame in frames], [frame.covered for frame in frames]
    begin = time.process_time()
    motion = motion_of(pictures)
    rows, flow = [], time.process_time() - begin
    every = drawn()
    for chosen in (even_frames(len(frames), FIRST), [key.frame for key in every.keys]):
        keys = key_masks(msgspec.structs.replace(every, keys=[key for key in every.keys if key.frame in chosen])).keys
        begin = time.process_time()
        thin, wide = (carry_masks(motion, keys, margin).excluded for margin in (0, MARGIN))
        seconds = (time.process_time() - begin) / 2
        corners = sum(len(shape.points) for key in every.keys if key.frame in chosen for shape in key.shapes)
        rows.append({"keys": len(keys), "corners": corners, "carry": seconds, **quality(thin, wide, truth)})
    return {"rows": rows, "flow": flow, "date": date.today().isoformat(), "machine": machine()}


def table(result: dict[str, Any]) -> str:
    """One row after each page."""
    rows, computing = [], result["flow"]
    for row in result["rows"]:
        computing += row["carry"]
        pace = LOOK * row["keys"] + CORNER * (row["corners"] + row["keys"])  # one more click closes a polygon
        cells = [f"{row['keys']}", f"{row['corners']}", f"{pace / 60:.1f}", f"{computing:.0f} s", f"{row['iou']:.3f}"]
        rows.append([*cells, f"{row['least_iou']:.2f}", f"{row['recall']:.2%}", f"{row['lost']:.1%}"])
    head = ["keys", "corners", "minutes of drawing", "computing until then"]
    head += ["IoU, mean", "IoU, worst frame", "instrument excluded", "tissue excluded"]
    about = (
        f"Simulated `cutting`, {SIZE['frames']} frames of 640x512, against the pixels that show the instrument; the"
        f" last two columns with a margin of {MARGIN} pixels. Drawing: {CORNER} s for a corner and {LOOK:g} s to look"
        f" at a frame. Computing: processor time of motion and carrying; {result['machine']['processor']},"
        f" {result['date']}."
    )
    return markdown(head, rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--table", action="store_true")
    if not parser.parse_args(words).table:
        write_json(FILE, measured())
    write_marked(PAGE, {"table": table(read_json(FILE, "python docs/make.py recordings.masks_drawn"))}, "masks_drawn")
