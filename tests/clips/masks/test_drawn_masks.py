"""Masks drawn as shapes: the pixels that they cover, the outlines of masks, and files that are refused."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from endotsr.clips.flow.clip_flows import ClipFlows
from endotsr.clips.masks.carry_masks import carry_masks
from endotsr.clips.masks.drawing import displacement, drawing_of, plausible_drafts
from endotsr.clips.masks.drawn_masks import FORMAT, MOST_POINTS, key_masks, read_drawn
from endotsr.clips.masks.mask_shapes import MaskShape, filled, inside_polygon, near_line, shapes_of
from endotsr.clips.masks.propose_masks import Proposal
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.sampling import even_frames
from endotsr.errors import InputError

WIDTH, HEIGHT = 50, 40
NAMES = ["a", "b <i>&", "c"]


def clip() -> Clip:
    return Clip("pictures", Path("clip"), list(NAMES), lambda chosen: iter(()))


def square(**changes) -> dict:
    return {"tool": "polygon", "points": [[5, 5], [20, 5], [20, 15], [5, 15]]} | changes


def content(**changes) -> dict:
    keys = [{"frame": 0, "name": "a", "shapes": [square()]}, {"frame": 2, "name": "c", "shapes": []}]
    return {"format": FORMAT, "frames": 3, "width": WIDTH, "height": HEIGHT, "keys": keys, "never": []} | changes


def read(folder: Path, data: object):
    file = folder / "keys.json"
    file.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    return read_drawn(file, clip(), WIDTH, HEIGHT)


def distances(points: np.ndarray) -> np.ndarray:
    """(H, W) distance of pixel centres to a line, by its definition."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    found = np.hypot(columns - points[0, 0], rows - points[0, 1])
    for a, b in itertools.pairwise(points):
        square = max(float(((b - a) ** 2).sum()), 1e-30)
        t = np.clip(((columns - a[0]) * (b[0] - a[0]) + (rows - a[1]) * (b[1] - a[1])) / square, 0, 1)
        found = np.minimum(found, np.hypot(columns - a[0] - t * (b[0] - a[0]), rows - a[1] - t * (b[1] - a[1])))
    return found


@pytest.mark.parametrize("seed", range(8))
def test_a_polygon_covers_the_centres_inside(seed):
    """Oracle: the angles under which a centre sees the edges add up to a whole number of turns; odd ones are inside."""
    points = np.random.default_rng(seed).uniform(-10, 60, (7, 2))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    seen = [np.arctan2(y - rows, x - columns) for x, y in np.vstack([points, points[:1]])]
    turns = sum((b - a + np.pi) % (2 * np.pi) - np.pi for a, b in itertools.pairwise(seen)) / (2 * np.pi)
    np.testing.assert_array_equal(inside_polygon(points, WIDTH, HEIGHT), np.round(turns).astype(int) % 2 == 1)


def test_a_polygon_of_whole_pixels_is_exact():
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[5:15, 5:20] = True
    np.testing.assert_array_equal(filled([MaskShape(tool="polygon", points=square()["points"])], WIDTH, HEIGHT), mask)
    assert not inside_polygon(np.array([[1.0, 1], [9, 9]]), WIDTH, HEIGHT).any()


@pytest.mark.parametrize("seed", range(8))
def test_a_stroke_covers_the_centres_near_its_line(seed):
    rng = np.random.default_rng(seed)
    points, radius = rng.uniform(-5, 55, (1 + seed, 2)), rng.uniform(0.3, 12)
    np.testing.assert_array_equal(near_line(points, radius, WIDTH, HEIGHT), distances(points) <= radius)


def test_shapes_add_and_erase_in_their_order():
    shapes = [MaskShape(tool="polygon", points=square()["points"])]
    shapes += [
        MaskShape(tool="brush", points=[(10, 10)], radius=3, erase=True),
        MaskShape(tool="brush", points=[(10, 10)], radius=1),
    ]
    found = filled(shapes, WIDTH, HEIGHT)
    assert found[9, 9] and not found[10, 11] and found[14, 18]
    assert not filled(shapes[:2], WIDTH, HEIGHT)[9, 9]


def test_a_mask_becomes_polygons_within_a_pixel():
    mask = distances(np.array([[15.0, 12], [38, 30]])) < 8
    mask[18:23, 22:28] = False
    shapes = shapes_of(mask, "colour")
    assert [shape.erase for shape in shapes] == [False, True] and shapes[0].origin == "colour"
    assert (filled(shapes, WIDTH, HEIGHT) != mask).sum() < 0.06 * mask.sum()
    assert shapes_of(np.zeros((HEIGHT, WIDTH), bool), "carried") == []


def test_a_region_inside_a_hole_is_kept():
    y, x = np.mgrid[:200, :200]
    far = np.hypot(y - 100, x - 100)
    mask = ((far > 60) & (far < 90)) | (far < 30)
    found = filled(shapes_of(mask, "drawn"), 200, 200)
    assert found[100, 100] and (found != mask).mean() < 0.01


def test_a_file_gives_its_masks(tmp_path):
    found = key_masks(read(tmp_path, content(never=[square(points=[[0, 30], [50, 30], [50, 40], [0, 40]])])))
    assert sorted(found.keys) == [0, 2] and not found.keys[2].any() and found.keys[0].sum() == 150
    assert found.never is not None and found.never.sum() == 500
    assert key_masks(read(tmp_path, content())).never is None


HOSTILE = {
    "no JSON": ("{", "cannot be read"),
    "a list": ([], "use an object"),
    "another format": (content(format="x"), "format: 'x' is not allowed"),
    "no format": ({}, "format: None is not allowed"),
    "unknown key": (content(more=1), "unknown field `more`"),
    "unknown key of a shape": (content(never=[square(colour="red")]), "unknown field `colour`"),
    "NaN": (json.dumps(content()).replace("20", "NaN"), "NaN is no JSON number"),
    "infinity": (json.dumps(content()).replace("20", "1e999"), "beyond the largest number"),
    "huge coordinate": (content(never=[square(points=[[1e6, 0]])]), "never[0].points[0][0]: expected `float` <= 16383"),
    "huge radius": (content(never=[square(tool="brush", radius=1e9)]), "never[0].radius"),
    "negative radius": (content(never=[square(radius=-1)]), "never[0].radius"),
    "no points": (content(never=[square(points=[])]), "never[0].points"),
    "a point of three numbers": (content(never=[square(points=[[1, 2, 3]])]), "never[0].points[0]"),
    "text for a number": (content(never=[square(points=[["1", 2]])]), "never[0].points[0][0]"),
    "another tool": (content(never=[square(tool="<script>")]), "never[0].tool: invalid enum value '<script>'"),
    "another clip": (content(frames=4), "frames: 4 is that of another clip; this clip has 3"),
    "another size": (content(width=51), "width: 51 is that of another clip; this clip has 50"),
    "a frame too far": (content(keys=[{"frame": 3, "name": "a", "shapes": []}]), "keys[0].frame: 3 is not a frame"),
    "a negative frame": (content(keys=[{"frame": -1, "name": "a", "shapes": []}]), "keys[0].frame"),
    "half a frame": (content(keys=[{"frame": 0.5, "name": "a", "shapes": []}]), "keys[0].frame"),
    "a frame twice": (content(keys=2 * [{"frame": 0, "name": "a", "shapes": []}]), "keys[1].frame: 0 stands twice"),
    "another name": (content(keys=[{"frame": 1, "name": "../x", "shapes": []}]), "keys[0].name: '../x' is not allowed"),
    "many points": (
        content(never=[square(points=[[0, 0]] * 4000)] * (MOST_POINTS // 4000 + 1)), f"use at most {MOST_POINTS}"
    ),
    "a long shape": (content(never=[square(points=[[0, 0]] * 5001)]), "never[0].points"),
    "many shapes": (content(never=[square(points=[[0, 0]])] * 1001), "never"),
    "nesting": ("[" * 100_000, "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_by_name(name, tmp_path):
    data, said = HOSTILE[name]
    with pytest.raises(InputError) as refused:
        read(tmp_path, data)
    assert said in str(refused.value) and "keys.json" in str(refused.value) and "\n" not in str(refused.value)


def moving(count: int) -> ClipFlows:
    """Everything moves by (3, -1) px a frame."""
    field = np.stack([np.full((HEIGHT, WIDTH), 3.0), np.full((HEIGHT, WIDTH), -1.0)]).astype(np.float32)
    return ClipFlows([field] * (count - 1), [-field] * (count - 1))


def test_points_are_followed_in_both_directions():
    points = np.array([[10.0, 20.0], [12.0, 30.0]])
    np.testing.assert_allclose(displacement(moving(5), 1, 3, points), [[6, 6], [-2, -2]])
    np.testing.assert_allclose(displacement(moving(5), 4, 1, points), [[-9, -9], [3, 3]])


def test_the_first_page_shows_even_frames_and_a_later_one_the_next(tmp_path):
    assert even_frames(63, 5) == [0, 16, 31, 46, 62] and even_frames(3, 5) == [0, 1, 2] and even_frames(9, 1) == [4]
    pictures = 3 * [np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)]
    colour = [np.zeros((HEIGHT, WIDTH), bool) for _ in range(3)]
    colour[0][10:20, 10:20] = colour[1][10:20, 10:20] = True
    border = np.zeros((HEIGHT, WIDTH), bool)
    border[:, :8] = True
    proposal = Proposal([plane | border for plane in colour], "", border=border)
    first = drawing_of(clip(), pictures, 2, proposal)
    np.testing.assert_array_equal(filled(first.never, WIDTH, HEIGHT), border)
    assert first.frames[0].draft and filled(first.frames[0].draft.shapes, WIDTH, HEIGHT)[5:, 12:].sum() > 50
    assert not filled(first.frames[0].draft.shapes, WIDTH, HEIGHT)[:, :8].any()
    assert [(f.frame, f.key, f.draft and f.draft.origin) for f in first.frames] == [
        (0, False, "colour"),
        (2, False, None),
    ]
    assert first.frames[0].ahead is not None and first.frames[0].back is None and first.columns == 3
    file = read(tmp_path, content(keys=[{"frame": 0, "name": "a", "shapes": [square()]}]))
    later = drawing_of(clip(), pictures, 2, None, file)
    assert [(f.frame, f.key, f.draft and f.draft.origin) for f in later.frames] == [
        (0, True, None),
        (2, False, "carried"),
    ]
    for wanted in (0, 61):
        with pytest.raises(InputError, match="use 1 to 60"):
            drawing_of(clip(), pictures, wanted, None)


def test_a_draft_that_its_neighbours_lack_is_not_offered():
    still = ClipFlows([np.zeros((2, HEIGHT, WIDTH), np.float32)] * 4, [np.zeros((2, HEIGHT, WIDTH), np.float32)] * 4)
    colour = [np.zeros((HEIGHT, WIDTH), bool) for _ in range(5)]
    for i in (0, 1, 2, 4):
        colour[i][5:25, 5:30] = True
    assert plausible_drafts(still, colour) == {0, 1}
    colour[2][5:25, 5:15] = False  # 60 % of the area is left
    assert plausible_drafts(still, colour) == {0, 1}
    assert plausible_drafts(ClipFlows([], []), colour[:1]) == set() and plausible_drafts(still, []) == set()


def test_a_further_key_leaves_the_other_gaps():
    motion, gaps = moving(9), {}
    keys = {0: np.zeros((HEIGHT, WIDTH), bool), 4: np.zeros((HEIGHT, WIDTH), bool), 8: np.ones((HEIGHT, WIDTH), bool)}
    first = carry_masks(motion, keys, known=gaps)
    kept = gaps[0, 4]
    again = carry_masks(motion, keys | {6: keys[8]}, 2, known=gaps)
    assert gaps[0, 4] is kept and (4, 6) in gaps and first.next_key in (5, 6, 7) and first.gain > 0.1
    alone = carry_masks(motion, keys | {6: keys[8]}, 2)
    assert again.agreement == alone.agreement and all(map(np.array_equal, again.excluded, alone.excluded))
