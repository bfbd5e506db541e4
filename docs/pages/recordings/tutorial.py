"""The pictures of docs/guides/tutorial.md: the steps of the tutorial at small size.

A raw recording is simulated in the layout of StereoMIS. Every step is a command of the page, at a size that takes a few
minutes on two cores.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib import colormaps

from endotsr.clips.formats.video_file import video_pictures
from endotsr.clips.masks.propose_masks import overlay
from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.layouts import describe
from pages.store.commands import said
from pages.store.program import RESULTS

SCENE = ["pulling", "--camera-motion.on", "--width", "240", "--height", "192", "--frames", "10"]
TRAINING = ["--preset", "demo", "--iterations", "200"]
DEPTH = ["--nearest", "25", "--farthest", "120"]
SHOWN = (0, 5, 9)  # frames; 9 is held out
Picture = np.ndarray


def coloured(depth: np.ndarray, low: float, high: float) -> Picture:
    """Depth (H, W) in colours, near = bright; black where there is none. (H, W, 3) uint8."""
    level = np.clip((high - depth) / (high - low), 0, 1)
    return np.where((depth > 0)[..., None], colormaps["inferno"](level)[..., :3] * 255, 0).astype(np.uint8)


def recorded(raw: Path) -> Picture:
    """Pictures of the video, left over right, side by side."""
    return np.concatenate(list(video_pictures(raw / "simulated.mp4", list(SHOWN))), axis=1)


def prepared(clip: Path) -> Picture:
    """Rows of picture, mask and depth."""
    opened = describe(clip)
    assert opened.masks is not None and opened.depth is not None
    rows = []
    for i, pair in zip(SHOWN, opened.pictures(list(SHOWN))):
        depth, tissue = opened.depth(i), opened.masks(i)
        assert depth is not None and tissue is not None
        rows.append(np.concatenate([pair.left, overlay(pair.left, ~tissue), coloured(depth, 35.0, 65.0)], axis=1))
    return np.concatenate(rows)


def reconstructed(clip: Path, renders: Path) -> Picture:
    """The held-out picture, its render, and three times the error."""
    truth = read_png(clip / "images" / f"{SHOWN[-1]:06d}.png")
    found = sorted((renders / "colour").glob(f"*{SHOWN[-1]:06d}*.png"))
    render = read_png(found[0])
    error = np.clip(3 * np.abs(truth.astype(int) - render[..., :3]), 0, 255).astype(np.uint8)
    return np.concatenate([truth, render[..., :3], error], axis=1)


def drawn(name: str, picture: Picture) -> None:
    """Write one picture of the page."""
    write_jpeg(RESULTS / f"tutorial_{name}.jpg", picture, quality=90)


def main(words: list[str]) -> None:
    """The command."""
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        raw, clip, run = root / "recording", root / "clip", root / "run"
        said("simulate", *SCENE, "--out", raw, "--layout", "stereomis")
        drawn("recording", recorded(raw))
        said("prepare", raw, "--out", clip)
        said("masks", clip, "--out", root / "proposal")
        drawn("proposal", read_png(root / "proposal" / "proposed_masks.png"))
        said("depth", clip, *DEPTH)
        drawn("sequence", prepared(clip))
        said("check", clip)
        said("train", clip, "--out", run, *TRAINING)
        said("render", run, "--frames", "test", "--out", root / "renders")
        drawn("scene", reconstructed(clip, root / "renders"))
