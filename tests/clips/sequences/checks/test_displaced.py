"""Depth that lies beside its masks is named with the pixels, and other holes are not."""

import numpy as np
import pytest

from data_folder import data_folder, recorded_masks
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.displaced import DisplacedDepth
from endotsr.config import PAPER
from synthetic_folder import identity_rows

HEIGHT, WIDTH, FRAMES = 80, 112, 8


def tissue_of(t):
    """Tissue beside an instrument that comes in from the right."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return ~((np.abs(y - HEIGHT / 2) < 12) & (x > 50 + 2 * t))


def found(x=0, y=0, holes=True, frames=FRAMES, tissue=tissue_of):
    """What is said of depth that lies x pixels to the right and y pixels down of its place."""
    parts = DisplacedDepth(frames)
    for t in range(frames):
        depth = np.where(tissue(t) | (not holes), 50.0, 0.0).astype(np.float32)
        parts.add(t, tissue(t), np.roll(depth, (y, x), (0, 1)))
    return [(f.code, f.where, f.what) for f in parts.findings("depth")]


def test_holes_in_their_place_and_depth_without_holes_have_no_finding():
    assert found() == found(holes=False) == found(x=1) == []


@pytest.mark.parametrize(("x", "y", "words"), [
    (3, 0, "3 pixels to the right of"), (-8, 0, "8 pixels to the left of"), (0, 4, "4 pixels down of"),
    (2, -5, "2 pixels to the right and 5 pixels up of"),
])  # fmt: skip
def test_displaced_depth_is_named_with_its_shift(x, y, words):
    ((code, where, what),) = found(x, y)
    assert (code, where) == ("displaced-depth", "depth") and f"lie {words} its place" in what and "0.0% if" in what


def test_holes_of_their_own_frames_without_masks_and_small_pictures_have_none():
    """Holes that a stereo method leaves lie anywhere; they do not fit the masks at any shift."""
    parts, without = DisplacedDepth(FRAMES), DisplacedDepth(FRAMES)
    for t in range(FRAMES):
        own = np.random.default_rng(t).uniform(size=(HEIGHT, WIDTH)) > 0.1
        parts.add(t, tissue_of(t), np.where(own, 50, 0).astype(np.float32))
        without.add(t, None if t == 0 else tissue_of(t), np.roll(tissue_of(t), 4, 0).astype(np.float32))
    assert parts.findings("depth") == without.findings("depth") == []
    assert found(y=4, tissue=lambda t: tissue_of(t)[10:70]) == []


def test_check_names_displaced_depth(tmp_path):
    for name in ("images", "masks", "depth"):
        (tmp_path / name).mkdir()
    for t in range(FRAMES):
        rng, tissue = np.random.default_rng(t), tissue_of(t)
        picture = np.where(tissue[..., None], [180, 70, 60], [120, 120, 125]) + rng.integers(
            -20, 20, (HEIGHT, WIDTH, 1)
        )
        planes = picture, 255 * ~tissue, np.roll(np.where(tissue, 50 + t % 3, 0), 4, 0)
        for name, plane in zip(("images", "masks", "depth"), planes):
            write_png(tmp_path / name / f"{t:06d}.png", plane.astype(np.uint8))
    np.save(tmp_path / "poses_bounds.npy", identity_rows(FRAMES, WIDTH, HEIGHT))
    assert "displaced-depth" in {f.code for f in check_sequence(tmp_path, PAPER).findings}


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting"])
def test_the_depth_of_the_recorded_clips_is_in_place_and_displaced_it_is_named(name):
    """With masks of the instruments alone, the holes follow no mask."""
    files = sorted((data_folder(name) / "depth").iterdir())
    for masks, shift, expected in (("masks", 0, []), ("masks", 3, ["displaced-depth"]), ("gt_masks", 0, [])):
        tissue, parts = recorded_masks(name, masks), DisplacedDepth(len(files))
        for i in sorted(parts._sampled):
            parts.add(i, tissue[i], np.roll(read_png(files[i]), shift, 1).astype(np.float32))
        assert [f.code for f in parts.findings("depth")] == expected
