"""Masks that were drawn by eye on the page, carried to a whole simulated clip: the table of docs/guides/masks.md.

    python docs/make.py recordings.masks_drawn measure      a minute

The polygons of docs/results/masks_drawn_keys.json were set from the pictures of the page alone: five frames of the
first page, then the three frames that the second page added. Nobody was timed with a mouse: the minutes follow from a
pace that is stated in the table, with which the corners were clicked in the page of a browser.
"""

import argparse
import time
from typing import Any

import msgspec

from endotsr.clips.flow.clip_flows import motion_of
from endotsr.clips.masks.carry_masks import carry_masks
from endotsr.clips.masks.drawn_masks import DrawnFile, key_masks
from endotsr.clips.sequences.sampling import even_frames
from pages.recordings.masked_clips import MARGIN, SIZE, pictures_of, quality, scene_frames
from pages.store.program import RESULTS, Program
from pages.store.tables import noted, where

DRAWN = RESULTS / "masks_drawn_keys.json"
CORNER, LOOK = 1.2, 4.0  # seconds for a corner, and for a look at a frame before its first corner
FIRST = 5  # frames of the first page, evenly spaced


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record: corners, quality against the instrument that the picture shows, and seconds of computing."""
    frames = scene_frames("cutting", **SIZE)
    pictures, truth = pictures_of(frames), [frame.covered for frame in frames]
    begin = time.process_time()
    motion = motion_of(pictures)
    rows, flow = [], time.process_time() - begin
    every = msgspec.json.decode(DRAWN.read_bytes(), type=DrawnFile)  # as the page saved them
    for chosen in (even_frames(len(frames), FIRST), [key.frame for key in every.keys]):
        keys = key_masks(msgspec.structs.replace(every, keys=[key for key in every.keys if key.frame in chosen])).keys
        begin = time.process_time()
        thin, wide = (carry_masks(motion, keys, margin).excluded for margin in (0, MARGIN))
        seconds = (time.process_time() - begin) / 2
        corners = sum(len(shape.points) for key in every.keys if key.frame in chosen for shape in key.shapes)
        rows.append({"keys": len(keys), "corners": corners, "carry": seconds, **quality(thin, wide, truth)})
    return {"rows": rows, "flow": flow}


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
        f" at a frame. Computing: processor time of motion and carrying; {where(result)}."
    )
    return noted(head, rows, about)


PROGRAM = Program(__name__, "guides/masks.md", {"table": table}, "masks_drawn.json", measured)
