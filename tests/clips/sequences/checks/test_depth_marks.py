"""Depth of single frames beside that of the others: a number that marks pixels without depth, one plane for all."""

import numpy as np
from depth_folders import true_depth
from made_videos import HEIGHT, WIDTH

from endotsr.clips.sequences.checks.depth import depth_facts, depth_findings, mark_finding


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


def test_planes_that_differ_are_not_called_one():
    def codes(planes) -> list[str]:
        facts = [depth_facts(f"{i}", plane, plane, None) for i, plane in enumerate(planes)]
        return [found.code for found in depth_findings(facts, "here", False, 0.2)]

    planes = [true_depth(i).astype(np.float32) for i in range(6)]
    assert codes(planes) == [] and codes([*planes, planes[-1]]) == []
    assert codes([planes[i // 3] for i in range(6)]) == ["still-depth"]
