"""Depth of another scale, with an offset or along the ray is named where the clip has a stereo pair."""

import dataclasses

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.depth_pair import Compared, depth_pair_findings, fit_findings, pair_fit
from endotsr.clips.sequences.layouts import describe_for_training
from endotsr.config import PAPER, SequenceConfig

WRONG = {
    "along the ray": lambda z, ray: z * ray,
    "15 mm more than": lambda z, ray: z + 15,
    "10 mm less than": lambda z, ray: z - 10,
    "5000 steps a metre": lambda z, ray: 5 * z,
    "metres": lambda z, ray: z / 1000,
}


def scene(count=5000, noise=0.001):
    """Compared pixels of a tilted plane with folds."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.5, 0.5, (2, count))
    depth = 50 + 12 * x + 4 * np.sin(9 * y)
    return Compared(np.rint(depth), depth * np.exp(rng.normal(0, noise, count)), np.sqrt(1 + x**2 + y**2))


def said(found, has_baseline=True):
    fit = pair_fit([found])
    return "" if fit is None else "".join(one.what for one in fit_findings(fit, has_baseline, "mm", "depth"))


@pytest.mark.parametrize("words", WRONG)
def test_each_wrong_depth_is_named_by_its_kind(words):
    right = scene()
    assert said(right) == ""
    assert words in said(right._replace(depth=WRONG[words](right.depth, right.ray)))


def test_without_a_baseline_the_scale_says_nothing_and_the_shape_does():
    right = scene()
    assert said(right._replace(of_pair=right.of_pair / 4), has_baseline=False) == ""
    wrong = right._replace(of_pair=right.of_pair / 4, depth=right.depth + 15)
    assert "a multiple of that of the stereo pairs" in said(wrong, has_baseline=False)


def test_a_flat_board_few_pixels_and_unrelated_depth_say_nothing():
    right = scene()
    board = right._replace(
        depth=np.full(5000, 50.0), of_pair=50 * np.exp(np.random.default_rng(1).normal(0, 0.01, 5000))
    )
    assert said(board) == ""
    assert pair_fit([Compared(*(values[:500] for values in right))]) is None
    unlike = right._replace(depth=np.random.default_rng(2).uniform(5, 400, 5000))
    assert pair_fit([unlike]) is None


def test_prepare_and_check_name_the_steps_of_tum(tmp_path, capsys):
    scene, clip = tmp_path / "scene", tmp_path / "clip"
    main(["simulate", "still", "--out", str(scene), "--width", "192", "--height", "160", "--frames", "3"])
    prepare = ["prepare", str(scene), "--out", str(clip), "--baseline", "4", "--replace"]
    assert main(prepare) == 0
    assert "depth-against-pair" not in capsys.readouterr().out
    assert all(found.code != "depth-against-pair" for found in check_sequence(clip, PAPER).findings)
    for file in (scene / "depth").iterdir():
        write_png(file, (read_png(file).astype(np.uint16) * 5).astype(np.uint16))
    assert main(prepare) == 0
    assert "warning: depth-against-pair: the depth is 5" in capsys.readouterr().out
    assert any(found.code == "depth-against-pair" for found in check_sequence(clip, PAPER).findings)


def test_the_depth_of_pulling_is_that_of_its_pairs():
    clip = describe_for_training(data_folder("endonerf_pulling"), SequenceConfig())
    assert depth_pair_findings(dataclasses.replace(clip, baseline=4.3)) == []
    read = clip.depth.read
    shifted = dataclasses.replace(clip.depth, read=lambda i: np.where(read(i) > 0, read(i) + 15, 0))
    (found,) = depth_pair_findings(dataclasses.replace(clip, baseline=4.3, depth=shifted))
    assert "mm more than" in found.what
