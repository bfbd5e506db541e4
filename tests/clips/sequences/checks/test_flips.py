"""Depth that lies upside down or mirrored against its picture is named, and nothing else is."""

import msgspec
import numpy as np
import pytest
from depth_folders import recording
from stereo_pairs import slanted_pair, stereo_folder

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.flips import FLIPS, DepthTurns, shading_finding, shading_fit, stereo_finding
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER, SequenceConfig

WIDTH, HEIGHT = 128, 96


def relief(i):
    """Folds that move a little, unlike any flip of them."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    places = np.random.default_rng(7).uniform((0, 0, -9), (WIDTH, HEIGHT, 9), (12, 3))
    return 50 + np.sum([h * np.exp(-((x - u - i) ** 2 + (y - v) ** 2) / 300) for u, v, h in places], axis=0)


def lit(depth):
    """The light of the scope falls with the square of the depth; a texture beside it."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    light = (45 / depth) ** 2 * (1 + 0.1 * np.sin(x / 3) * np.cos(y / 4))
    return np.clip(light[..., None] * np.array([180, 90, 70]), 0, 255).astype(np.uint8)


def said(pictures, depth, masks=None):
    masks = [None] * len(depth) if masks is None else masks
    fits = [shading_fit(p, np.asarray(d, np.float32), m) for p, d, m in zip(pictures, depth, masks)]
    return [found.what for found in shading_finding([fit for fit in fits if fit is not None], "depth")]


def test_each_flip_is_named_and_the_right_depth_is_not():
    depth = [relief(i) for i in range(3)]
    pictures = [lit(plane) for plane in depth]
    assert said(pictures, depth) == []
    for name, axes in FLIPS.items():
        (what,) = said(pictures, [np.flip(plane, axes) for plane in depth])
        assert what.startswith(f"over 3 frames the depth fits the light {name} (")


def turned(planes):
    turns = DepthTurns()
    for i, plane in enumerate(planes):
        turns.add(i, None if plane is None else np.asarray(plane, np.float32))
    return [(found.frame, found.what) for found in turns.findings("depth")]


@pytest.mark.parametrize(
    ("frames", "named"), [((4,), "1 frame"), ((0,), "1 frame"), ((9,), "1 frame"), ((6, 7, 8, 9), "4 frames")]
)
def test_frames_of_another_orientation_than_most_are_named(frames, named):
    for name, axes in FLIPS.items():
        planes = [np.flip(relief(i), axes) if i in frames else relief(i) for i in range(10)]
        ((frame, what),) = turned(planes)
        listed = ", ".join(map(str, frames))
        assert frame == frames[0]
        assert what == f"the depth of {named} is {name} in comparison with its neighbours: {listed}"


def test_depth_of_one_orientation_a_board_and_frames_without_depth_are_not_named():
    planes = [relief(i) for i in range(8)]
    assert turned(planes) == turned([*planes[:3], None, np.zeros_like(planes[0]), *planes[3:]]) == []
    assert turned([np.full((HEIGHT, WIDTH), 50.0)] * 4) == turned([]) == []


def test_an_inverse_depth_a_board_and_a_few_pixels_are_no_flips():
    depth = relief(0)
    assert said([lit(depth)], [1800 / depth]) == []
    assert said([lit(depth)], [depth * 0 + 50]) == said([lit(depth)], [depth * 0]) == []
    assert said([lit(depth)[:8, :8]], [depth[:8, :8]]) == said([lit(depth)[:1]], [depth[:1]]) == []


@pytest.mark.parametrize("name", ["pulling", "moving-camera", "everything"])
@pytest.mark.parametrize("seed", [0, 1])
def test_texture_without_light_of_the_scope_says_nothing(name, seed):
    size = {"width": 160, "height": 128, "frames": 3, "seed": seed}
    clip = simulate(msgspec.structs.replace(named_scene(name), **size)).sequence
    pictures = clip.images.transpose(0, 2, 3, 1)
    for axes in ((), *FLIPS.values()):
        assert said(pictures, np.flip(clip.depth, tuple(axis + 1 for axis in axes)), clip.masks) == []


def test_prepare_refuses_and_check_warns(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("depth_folders.lit_picture", lambda i: lit(relief(i)))
    words = recording(tmp_path, lambda i: relief(i)[::-1])
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "fits the light upside down" in error and "--trust-depth" in error and "disparity" not in error
    assert main([*words, "--trust-depth"]) == 0
    found = {f.code: f for f in check_sequence(tmp_path / "o", PAPER).findings}
    assert found["flipped-depth"].level == "warning" and "first row at the top" in found["flipped-depth"].remedy


def test_the_stereo_pair_tells_a_flip_from_a_disparity(tmp_path):
    disparity = slanted_pair()[2]
    depth = 1000 / disparity
    assert stereo_finding(depth, disparity, "d", 0) == []
    assert stereo_finding(disparity, disparity, "d", 0)[0].code == "inverted-depth"
    found = stereo_finding(depth[:, ::-1], disparity, "d", 0)
    assert found[0].code == "flipped-depth" and "fits the stereo pair mirrored (" in found[0].what
    stereo_folder(tmp_path)
    assert main(["depth", str(tmp_path), "--nearest", "25", "--farthest", "120"]) == 0
    assert "flipped-depth" not in [f.code for f in check_sequence(tmp_path, PAPER).findings]
    write_png(tmp_path / "depth/000000.png", read_png(tmp_path / "depth/000000.png")[:, ::-1])
    codes = [f.code for f in check_sequence(tmp_path, PAPER).findings]
    assert "flipped-depth" in codes and "inverted-depth" not in codes


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "sinus_endoscopy"])
def test_real_clips(name, tmp_path):
    folder = data_folder(name)
    if name == "sinus_endoscopy":
        assert main(["prepare", str(folder), "--out", str(tmp_path / "clip"), "--scale", "0.25"]) == 0
        folder = tmp_path / "clip"
    clip = read_sequence(folder, SequenceConfig(frames="0:35:4"), 0.2)
    pictures = clip.images.transpose(0, 2, 3, 1)
    assert said(pictures, clip.depth, clip.masks) == []
    for flip, axes in FLIPS.items():
        (what,) = said(pictures, np.flip(clip.depth, tuple(axis + 1 for axis in axes)), clip.masks)
        assert f"light {flip} (" in what
