"""Masks, depth and right views of other moments than their pictures are named, and those of one moment are not."""

import msgspec
import numpy as np
import pytest

from data_folder import data_folder, recorded_masks
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks import late
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.late import FARTHEST, FEWEST, LateParts, loaded_late_findings
from endotsr.clips.sequences.checks.stereo import late_steps_finding
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER
from synthetic_folder import identity_rows

HEIGHT, WIDTH, FRAMES = 64, 96, 40


def moment(t):
    """Grey instrument that swings over red tissue: picture, mask, depth with holes under the mask."""
    x = np.arange(WIDTH)
    tissue = np.broadcast_to(np.abs(x - (WIDTH / 2 + 30 * np.sin(t / 4))) > 8, (HEIGHT, WIDTH))
    noise = np.random.default_rng(t + 99).integers(-20, 20, (HEIGHT, WIDTH, 1))
    picture = np.where(tissue[..., None], [180, 70, 60], [120, 120, 125]) + noise
    return picture.astype(np.uint8), tissue, np.where(tissue, 50.0, 0.0).astype(np.float32)


def found(masks=0, depth=0, frames=FRAMES, holes=True):
    """Findings where masks and depth are late by these numbers of frames."""
    parts = LateParts()
    for t in range(frames):
        prior = moment(t - depth)[2] if holes else np.full((HEIGHT, WIDTH), 50, np.float32)
        parts.add(moment(t)[0], moment(t - masks)[1], prior)
    return [(f.code, f.where, f.what) for f in parts.findings("masks", "depth")]


def test_what_is_of_one_moment_has_no_finding():
    assert found() == found(holes=False) == []


@pytest.mark.parametrize(("lag", "words"), [(3, "3 frames late"), (-3, "3 frames early"), (6, "6 frames late")])
def test_late_and_early_masks_are_named(lag, words):
    ((code, where, what),) = found(masks=lag, holes=False)
    assert (code, where) == ("late-masks", "masks") and f"about {words}" in what
    assert found(masks=lag, frames=2 * FARTHEST + FEWEST - 1) == []


@pytest.mark.parametrize(("lag", "words"), [(1, "1 frame late"), (-4, "4 frames early")])
def test_holes_of_another_frame_are_named(lag, words):
    ((code, where, what),) = found(depth=lag)
    assert (code, where) == ("late-depth", "depth") and f"be {words}: its holes" in what and "0.0% if" in what


def test_masks_and_holes_in_reversed_order_are_named():
    masks, holes = LateParts(), LateParts()
    for t in range(FRAMES):
        masks.add(moment(t)[0], moment(FRAMES - 1 - t)[1], None)
        holes.add(*moment(t)[:2], moment(FRAMES - 1 - t)[2])
    for parts, code in ((masks, "late-masks"), (holes, "late-depth")):
        ((found,),) = [parts.findings("masks", "depth")]
        assert found.code == code and "reversed order" in found.what


def test_a_still_mask_colours_without_difference_and_frames_without_masks_have_none():
    picture, tissue, depth = moment(0)
    still, alike, without = LateParts(), LateParts(), LateParts()
    for t in range(FRAMES):
        still.add(moment(t)[0], tissue, depth)
        alike.add(np.full_like(picture, 90), moment(t - 3)[1], None)
        without.add(picture, None if t == 2 else moment(t - 3)[1], None)
    assert still.findings("m", "d") == alike.findings("m", "d") == without.findings("m", "d") == []


@pytest.mark.parametrize("name", ["everything", "pulling"])
def test_a_simulated_clip_has_no_finding_and_its_late_masks_have_one(name):
    settings = msgspec.structs.replace(named_scene(name), frames=30, width=160, height=128)
    clip = simulate(settings).sequence
    assert loaded_late_findings(clip, "masks", "depth") == []
    if name == "everything":  # the instrument of the other scene stays
        parts = LateParts()
        for picture, tissue, depth in zip(clip.images[5:], clip.masks[:-5], clip.depth[5:]):
            parts.add(picture.transpose(1, 2, 0), tissue, depth)
        assert [f.code for f in parts.findings("masks", "depth")] == ["late-masks"]


@pytest.mark.parametrize(("order", "words"), [(slice(None, None, -1), "in reversed order"), (slice(0, 27), "late")])
def test_masks_from_the_last_to_the_first_are_no_late_masks_where_an_instrument_comes_and_goes(order, words):
    """Moved by seven frames, masks in reversed order tell more of the colours than unmoved, but less than turned."""
    settings = msgspec.structs.replace(named_scene("pulling"), frames=32, width=160, height=128)
    clip, parts = simulate(settings).sequence, LateParts()
    masks = clip.masks[order]
    for picture, tissue in zip(clip.images[-len(masks) :], masks):
        parts.add(picture.transpose(1, 2, 0), tissue, None)
    (found,) = parts.findings("masks", "depth")
    assert found.code == "late-masks" and words in found.what


@pytest.mark.parametrize("lag", [0, 1, 3, -5])
def test_steps_of_a_right_view_tell_its_moment(lag):
    """Fast and slow motion, with a little noise in both views; a shift of one frame is within what cameras do."""
    speed = np.exp(np.convolve(np.random.default_rng(3).normal(size=80), np.ones(4) / 2, "valid"))
    noise = np.random.default_rng(4).uniform(0.95, 1.05, (2, 60))
    left, right = speed[8:68] * noise[0], speed[8 - lag : 68 - lag] * noise[1]
    said = [(f.code, f.what.split(":")[0]) for f in late_steps_finding(left, right, "right")]
    word = "late" if lag > 0 else "early"
    assert said == ([("late-right-view", f"the right view is about {abs(lag)} frames {word}")] if abs(lag) > 1 else [])
    assert late_steps_finding(left[:23], right[:23], "right") == []
    assert late_steps_finding(np.ones(60), right, "right") == late_steps_finding(left, np.zeros(60), "right") == []


def test_check_names_late_masks_and_late_depth(tmp_path):
    for lags, code in (((0, 0), None), ((3, 0), "late-masks"), ((0, 3), "late-depth")):
        folder = tmp_path / f"{code}"
        for name in ("images", "masks", "depth"):
            (folder / name).mkdir(parents=True)
        for t in range(2 * FARTHEST + FEWEST):
            planes = moment(t)[0], 255 * ~moment(t - lags[0])[1], moment(t - lags[1])[2]
            for name, plane in zip(("images", "masks", "depth"), planes):
                write_png(folder / name / f"{t:06d}.png", plane.astype(np.uint8))
        np.save(folder / "poses_bounds.npy", identity_rows(2 * FARTHEST + FEWEST, WIDTH, HEIGHT))
        codes = {f.code for f in check_sequence(folder, PAPER).findings}
        assert codes & {"late-masks", "late-depth"} == ({code} if code else set())


def recorded(name, frames, rows=slice(None), late=0, masks="gt_masks", late_depth=None):
    """Findings on a part of a clip, with masks of `late` frames before, and with depth where its lag is stated."""
    folder, tissue, parts = data_folder(name), recorded_masks(name, masks), LateParts()
    pictures, depth = (sorted((folder / part).iterdir()) for part in ("images", "depth"))
    for i in frames:
        prior = None if late_depth is None else read_png(depth[i - late_depth])[rows].astype(np.float32)
        parts.add(read_png(pictures[i])[rows], tissue[i - late][rows], prior)
    return [f.code for f in parts.findings("masks", "depth")]


@pytest.mark.data
@pytest.mark.parametrize(("name", "frames", "rows"), [
    ("endonerf_pulling", range(24), slice(None)),
    ("endonerf_pulling", range(63), slice(256, None)),
    ("endonerf_cutting", range(124, 156), slice(None)),
])  # fmt: skip
def test_parts_of_the_recorded_clips_have_no_late_masks(name, frames, rows):
    """Other shifts than 0 fit them a little better: an instrument enters or grows."""
    assert recorded(name, frames, rows) == []


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting"])
def test_the_recorded_clips_have_a_finding_with_late_files_alone(name):
    assert recorded(name, range(5, 40), late=5) == ["late-masks"]
    for masks, depth, expected in ((0, 0, []), (5, 0, ["late-masks"]), (0, 5, ["late-depth"])):
        assert recorded(name, range(5, 45), late=masks, masks="masks", late_depth=depth) == expected


@pytest.mark.parametrize(("limit", "value"), [("INFORMED", 10.0), ("TIMES", 1000.0)])
def test_late_masks_have_to_tell_more_of_the_colours_by_both_limits(limit, value, monkeypatch):
    """Masks that are late by 3 frames exceed both limits, and none that is higher than what they gain."""
    assert [code for code, *_ in found(masks=3, holes=False)] == ["late-masks"]
    monkeypatch.setattr(late, limit, value)
    assert found(masks=3, holes=False) == []
