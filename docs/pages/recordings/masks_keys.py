"""Measure carried masks against the number of key frames, and drafts by colour: figure and tables of a guide.

    python docs/make.py recordings.masks_keys [--data ../shared/data]   measure, some minutes
    python docs/make.py recordings.masks_keys --table                   rewrite figure and tables of the last result

The keys are true masks: exact ones of a simulated scene, and `gt_masks` of the EndoNeRF clips, which are polygons drawn
by hand. Keys are evenly spaced, or proposed: the first one is the middle frame, each further one the next key of the
carried masks. The result is docs/results/masks_keys.json, the figure docs/results/masks_keys.svg, the page
docs/guides/masks.md.
"""

import argparse
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv import read_png
from endotsr.clips.sequences import carry_masks as carry
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.clip_flows import motion_of
from endotsr.clips.sequences.drawing import instruments_of, plausible_drafts
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.make_masks import left_pictures
from endotsr.clips.sequences.propose_masks import propose_masks
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.splits import even_frames
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import with_settings
from endotsr.method.kernels.arrays import BoolArray
from endotsr.results.report import style
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, FIGURE, PAGE = DOCS / "results/masks_keys.json", DOCS / "results/masks_keys.svg", DOCS / "guides/masks.md"
COUNTS = (1, 2, 4, 6, 8, 12, 16, 24, 32, 40)
MARGIN = 2
SIMULATED, SIZE = "simulated, `cutting`", {"width": 640, "height": 512, "frames": 60}
REAL = ("endonerf_pulling", "endonerf_cutting")
WITHOUT = "sinus_endoscopy"  # 35 frames without an instrument
PANELS = {"iou": "mean intersection over union, margin 0", "recall": f"instrument pixels excluded, margin {MARGIN}",
          "lost": f"tissue excluded, margin {MARGIN}"}  # fmt: skip


def simulated() -> tuple[list[Picture], list[BoolArray]]:
    """Pictures (H, W, 3) and exact masks of a scene."""
    frames = list(simulated_frames(make_scene(with_settings(named_scene("cutting"), **SIZE))))
    return [frame.image.transpose(1, 2, 0) for frame in frames], [frame.excluded for frame in frames]


def real(folder: Path) -> tuple[list[Picture], list[BoolArray]]:
    """Pictures and `gt_masks` of a folder in the layout of EndoNeRF."""
    pictures, masks = (
        [read_png(file) for file in sorted((folder / name).iterdir())] for name in ("images", "gt_masks")
    )
    return pictures, [(plane if plane.ndim == 2 else plane[..., 0]) > 127 for plane in masks]


def quality(thin: list[BoolArray], wide: list[BoolArray], truth: list[BoolArray]) -> dict[str, float]:
    """Mean and least intersection over union without a margin; recall and lost tissue of all pixels with one."""
    overlaps = [np.count_nonzero(a & t) / max(np.count_nonzero(a | t), 1) for a, t in zip(thin, truth) if t.any()]
    instrument = sum(np.count_nonzero(t) for t in truth)
    found = sum(np.count_nonzero(a & t) for a, t in zip(wide, truth))
    lost = sum(np.count_nonzero(a & ~t) for a, t in zip(wide, truth))
    tissue = sum(t.size for t in truth) - instrument
    return {"iou": float(np.mean(overlaps)), "least_iou": min(overlaps), "recall": found / instrument,
            "lost": lost / tissue}  # fmt: skip


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
    return {"frames": len(pictures), "marked": len(marked), "worse": len(worse), "offered": len(offered),
            "offered_worse": len(offered & worse)}  # fmt: skip


def measured(data: Path) -> dict[str, Any]:
    """The record."""
    found: dict[str, Any] = {"clips": {}, "drafts": {}}
    for name in (SIMULATED, *(name for name in REAL if (data / name).is_dir())):
        pictures, truth = simulated() if name == SIMULATED else real(data / name)
        found["clips"][name] = curves(pictures, truth)
        found["drafts"][name] = drafts(pictures, truth)
        print(name, flush=True)
    if (data / WITHOUT).is_dir():
        pictures = list(left_pictures(describe(data / WITHOUT, SourceOptions())))
        found["drafts"][WITHOUT] = drafts(pictures, None)
    return found | {"date": date.today().isoformat(), "machine": machine(), "gain": carry.LEAST_GAIN}


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
    style.save(figure, FIGURE)


def table(result: dict[str, Any]) -> str:
    """Rows at some numbers of keys."""
    rows = []
    for name, clip in result["clips"].items():
        for kind in ("even", "proposed"):
            for n, row in clip[kind].items():
                if int(n) in (2, 4, 8, 16, clip["stop"] if kind == "proposed" else 0):
                    stops = ", stop" if kind == "proposed" and int(n) == clip["stop"] else ""
                    cells = [
                        f"{row['iou']:.3f}",
                        f"{row['least_iou']:.2f}",
                        f"{row['recall']:.2%}",
                        f"{row['lost']:.1%}",
                    ]
                    rows.append([name, f"{n} {kind}{stops}", *cells])
    head = ["Clip", "keys", "IoU, mean", "IoU, worst frame", "instrument excluded", "tissue excluded"]
    about = f"The last two columns with a margin of {MARGIN} pixels. Simulated: {SIZE['frames']} frames of 640x512."
    return markdown(head, rows) + f"\n\n{about} {result['date']}."


def draft_table(result: dict[str, Any]) -> str:
    """Drafts by colour."""
    rows = [[name, *(str(row[key]) for key in ("frames", "marked", "worse", "offered", "offered_worse"))]
            for name, row in result["drafts"].items()]  # fmt: skip
    head = ["Clip", "frames", "with a draft", "of these worse than no draft", "offered", "offered, worse than no draft"]
    return markdown(head, rows)


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DOCS.parents[1] / "shared" / "data")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        write_json(FILE, measured(options.data))
    found = read_json(FILE, "python docs/make.py recordings.masks_keys")
    draw(found)
    write_marked(PAGE, {"table": table(found), "drafts": draft_table(found)}, "mask_keys")
