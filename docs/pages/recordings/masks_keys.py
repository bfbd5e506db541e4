"""Measure carried masks against the number of key frames, and drafts by colour: figure and tables of a guide.

    python docs/make.py recordings.masks_keys measure [--data ../shared/data]   some minutes

The keys are true masks: exact ones of a simulated scene, and `gt_masks` of the EndoNeRF clips, which are polygons drawn
by hand. Keys are evenly spaced, or proposed: the first one is the middle frame, each further one the next key of the
carried masks. The figure is docs/results/masks_keys.svg, the page docs/guides/masks.md.
"""

import argparse
from typing import Any

import numpy as np

from endotsr.clips.flow.clip_flows import motion_of
from endotsr.clips.masks import carry_masks as carry
from endotsr.clips.masks.drawing import instruments_of, plausible_drafts
from endotsr.clips.masks.propose_masks import propose_masks
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.clip_pictures import left_pictures
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.method.kernels.arrays import BoolArray
from endotsr.results.report import style
from endotsr.results.report.tables import markdown
from pages.recordings.masked_clips import MARGIN, SIZE, quality, real, simulated
from pages.store.program import DATA, RESULTS, Program
from pages.store.tables import noted

COUNTS = (1, 2, 4, 6, 8, 12, 16, 24, 32, 40)
SIMULATED, REAL = "simulated, `cutting`", ("endonerf_pulling", "endonerf_cutting")
WITHOUT = "sinus_endoscopy"  # 35 frames without an instrument
PANELS = {"iou": "mean intersection over union, margin 0", "recall": f"instrument pixels excluded, margin {MARGIN}",
          "lost": f"tissue excluded, margin {MARGIN}"}  # fmt: skip
DRAFTS = ("frames", "marked", "worse", "offered", "offered_worse")


def curves(pictures: list[Picture], truth: list[BoolArray]) -> dict[str, Any]:
    """Quality by number of keys, for both ways to choose them; and the number at which the proposals stop."""
    motion, count = motion_of(pictures), len(pictures)

    def at(frames: list[int], known: carry.Gaps) -> dict[str, float]:
        keys = {k: truth[k] for k in frames}
        thin, wide = (carry.carry_masks(motion, keys, margin, known).excluded for margin in (0, MARGIN))
        return quality(thin, wide, truth)

    even = {n: at(even_frames(count, n), {}) for n in COUNTS if n <= count}
    frames, gaps, proposed, stop = [count // 2], {}, {}, 0
    while len(frames) <= max(COUNTS):
        if len(frames) in COUNTS:
            proposed[len(frames)] = at(frames, gaps)
        found = carry.carry_masks(motion, {k: truth[k] for k in frames}, known=gaps)
        if found.next_key is None:
            stop = len(frames)
            proposed.setdefault(stop, at(frames, gaps))
            break
        frames.append(found.next_key)
    return {"frames": count, "even": even, "proposed": proposed, "order": frames, "stop": stop}


def drafts(pictures: list[Picture], truth: list[BoolArray] | None) -> dict[str, int]:
    """Frames with a draft by colour, those that the page offers, and those that are worse than an empty mask."""
    colour = instruments_of(propose_masks(pictures))
    marked = [i for i, plane in enumerate(colour) if plane.any()]
    offered = plausible_drafts(motion_of(pictures), colour) if colour else set()
    true = truth or [np.zeros(picture.shape[:2], bool) for picture in pictures]
    worse = {i for i in marked if np.count_nonzero(colour[i] ^ true[i]) >= np.count_nonzero(true[i])}
    counts = (len(pictures), len(marked), len(worse), len(offered), len(offered & worse))
    return dict(zip(DRAFTS, counts, strict=True))


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record."""
    data = options.data
    found: dict[str, Any] = {"clips": {}, "drafts": {}}
    for name in (SIMULATED, *(name for name in REAL if (data / name).is_dir())):
        pictures, truth = simulated("cutting", **SIZE) if name == SIMULATED else real(data / name)
        found["clips"][name] = curves(pictures, truth)
        found["drafts"][name] = drafts(pictures, truth)
        print(name, flush=True)
    if (data / WITHOUT).is_dir():
        pictures = list(left_pictures(describe(data / WITHOUT, SourceOptions())))
        found["drafts"][WITHOUT] = drafts(pictures, None)
    return found | {"gain": carry.LEAST_GAIN}


def draw(result: dict[str, Any]) -> None:
    """The figure: one panel for each measure, one colour for each clip, dashed with proposed keys."""
    figure = style.new_figure(10.5, 3.4)
    every = figure.subplots(1, len(PANELS))
    for axes, (key, title) in zip(every, PANELS.items()):
        for colour, (name, clip) in zip(style.LIGHT.colours, result["clips"].items()):
            for kind, line in (("even", "-"), ("proposed", "--")):
                rows = {int(n): row[key] for n, row in clip[kind].items()}
                label = f"{name.replace('`', '')}, {kind}"
                axes.plot(list(rows), list(rows.values()), line, color=colour, linewidth=1.4, marker=".", label=label)
        axes.set_xscale("log", base=2)
        axes.set_xticks([1, 2, 4, 8, 16, 32], labels=["1", "2", "4", "8", "16", "32"])
        style.plain_axes(axes, sizes=style.SMALL)
        style.name_axes(axes, "key frames", "", title, sizes=style.SMALL)
    style.legend(every[0], sizes=style.SMALL, loc="lower right")
    style.save(figure, RESULTS / "masks_keys.svg")


def table(result: dict[str, Any]) -> str:
    """Rows at some numbers of keys."""
    rows = []
    for name, clip in result["clips"].items():
        for kind in ("even", "proposed"):
            for n, row in clip[kind].items():
                if int(n) in (2, 4, 8, 16, clip["stop"] if kind == "proposed" else 0):
                    stops = ", stop" if kind == "proposed" and int(n) == clip["stop"] else ""
                    overlap = (f"{row['iou']:.3f}", f"{row['least_iou']:.2f}")
                    rows.append([name, f"{n} {kind}{stops}", *overlap, f"{row['recall']:.2%}", f"{row['lost']:.1%}"])
    head = ["Clip", "keys", "IoU, mean", "IoU, worst frame", "instrument excluded", "tissue excluded"]
    about = f"The last two columns with a margin of {MARGIN} pixels. Simulated: {SIZE['frames']} frames of 640x512."
    return noted(head, rows, f"{about} {result['date'][:10]}.")


def draft_table(result: dict[str, Any]) -> str:
    """Drafts by colour."""
    rows = [[name, *(str(row[key]) for key in DRAFTS)] for name, row in result["drafts"].items()]
    head = ["Clip", "frames", "with a draft", "of these worse than no draft", "offered", "offered, worse than no draft"]
    return markdown(head, rows)


PROGRAM = Program(
    __name__, "guides/masks.md", {"table": table, "drafts": draft_table}, "masks_keys.json", measured,
    {"--data": DATA}, draw, room="mask_keys",
)  # fmt: skip
