"""What the checks of `exported_inputs.py` say of right inputs: nothing."""

from pathlib import Path

import numpy as np
import pytest
from depth_folders import true_depth
from exported_inputs import of_all_frames
from made_videos import HEIGHT, WIDTH

from endotsr.cli.main import main
from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.sequences.checks.cameras import intrinsics_findings
from endotsr.clips.sequences.checks.depth import depth_facts, mark_finding
from endotsr.clips.sequences.pairing import paired


@pytest.mark.parametrize(("centre", "factor"), [
    ((640.0, 512.0), ""), ((597.5, 520.9), ""), ((540.0, 430.0), ""), ((320.0, 256.0), "0.5"),
    ((426.7, 341.3), "0.667"), ((960.0, 768.0), "1.5"), ((1280.0, 1024.0), "2"), ((320.0, 512.0), ""),
])  # fmt: skip
def test_a_principal_point_of_another_picture_size_is_named_with_the_size(centre, factor):
    lens = Intrinsics(1035.0, 1035.0, centre[0], centre[1], 1280, 1024)
    (what,) = [found.what for found in intrinsics_findings(lens, "")] or [""]
    assert (f"the centre of pictures of {factor} times this size" in what) == bool(factor)
    assert bool(what) == bool(factor)


def marks(planes) -> list[str]:
    return [found.what for found in mark_finding([depth_facts("", p.astype(np.float32), p, None) for p in planes], "")]


def test_one_number_apart_from_all_depths_of_every_frame_is_a_mark():
    def with_hole(i, value, size=20):
        plane = true_depth(i)
        plane[:size, :size] = value
        return plane

    for value, said in ((150.0, "at most 67"), (1e-3, "at least 39")):
        (what,) = marks([with_hole(i, value) for i in range(6)])
        assert f"the depth {value:.4g} in every frame" in what and said in what
        assert marks([with_hole(i, value, 4) for i in range(6)]) == []  # a few pixels
        assert marks([with_hole(i, value + i) for i in range(6)]) == []  # another number in each frame
        assert marks([with_hole(i, value) for i in range(3)]) == []  # too few frames
    assert marks([with_hole(i, 80.0) for i in range(6)]) == []  # beside the other depths


def test_whole_millimetres_and_clipped_depth_have_no_mark():
    assert marks([np.rint(true_depth(i)) for i in range(6)]) == []
    assert marks([np.clip(true_depth(i), 42, 60) for i in range(6)]) == []
    assert marks([np.full((HEIGHT, WIDTH), 50.0)] * 6) == []


@pytest.mark.parametrize(("name", "said"), [("{}.png", True), ("{:02}.png", False), ("frame-{:04}.color.png", False)])
def test_names_that_sort_otherwise_as_text_are_named_for_an_array(name, said, tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((12, 8, 8)))
    planes = [tmp_path / f"a.npy/{k:06d}" for k in range(12)]
    found = paired([Path("clip") / name.format(k) for k in range(12)], planes)
    assert ("10.png stands in the place of 2.png" in found.note) == said


def test_an_array_of_names_with_zeros_needs_no_caution(tmp_path, capsys):
    words = of_all_frames(lambda k: true_depth(k).astype(np.float32), "--depth", lambda k: f"{k:02d}.png")(tmp_path)
    assert main(words) == 0
    assert "leading zeros" not in capsys.readouterr().out
