"""`prepare --depth`: a disparity, an inverse or a stretched depth is not read as millimetres in silence."""

import numpy as np
import pytest
from depth_folders import WRONG, recording, true_depth
from made_videos import files
from raw_sources import colmap
from stereo_pairs import slanted_pair

from endotsr.cli.main import main
from endotsr.clips.prepare.stated_depth import bytes_exchanged


@pytest.mark.parametrize("case", ["disparity in pixels", "stretched to 16 bits", "metres"])
def test_the_refusal_of_what_is_no_length_names_two_remedies(case, tmp_path, capsys):
    """What is said of each case is in `inputs_tried.py`."""
    values, name, kind, _ = WRONG[case]
    words = recording(tmp_path, values, name, kind)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "--kind disparity" in error and "--trust-depth" in error
    assert main([*words, "--trust-depth"]) == 0


def test_the_parallax_of_a_pair_speaks_against_a_disparity(tmp_path, capsys):
    left, right, moved = slanted_pair()[:3]
    for name, picture in (("left", left), ("right", right)):
        files(tmp_path / "clip", name, [np.roll(picture, i, 0) for i in range(3)])
    files(tmp_path, "depth", [np.roll(moved, i, 0).astype(np.float32) for i in range(3)], "npy")
    height, width = left.shape[:2]
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), "--baseline", "4"]
    words += ["--camera", "200", "200", str(width / 2), str(height / 2), "--depth", str(tmp_path / "depth")]
    assert main(words) == 2
    assert "depth decreases where the stereo pair is farther" in capsys.readouterr().err


def test_an_option_that_the_layout_does_not_read_is_refused(tmp_path, capsys):
    colmap(tmp_path / "model", False)
    (tmp_path / "d").mkdir()
    for option in (["--depth", str(tmp_path / "d")], ["--camera", "9", "9", "9", "9"], ["--baseline", "4"]):
        assert main(["prepare", str(tmp_path / "model"), "--out", str(tmp_path / "o"), *option]) == 2
        assert (
            f"the layout colmap does not read {option[0]}; of these options it reads --masks" in capsys.readouterr().err
        )


@pytest.mark.parametrize("scale", [10, 100, 256])
def test_the_bytes_of_right_depth_are_not_exchanged(scale):
    stored = np.round(true_depth(0) * scale).astype(np.uint16)
    assert not bytes_exchanged(stored.astype(np.float32))
    assert bytes_exchanged(stored.byteswap().astype(np.float32))
