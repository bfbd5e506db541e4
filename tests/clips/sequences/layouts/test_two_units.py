"""An arbitrary unit beside the baseline of a pair, which is a length in millimetres: two scales in one clip."""

import pytest
from common_folder import moving, written
from made_videos import files
from raw_sources import ini, scene_picture

from endotsr.cli.main import main
from endotsr.clips.sequences.sequence_file import read_sequence_file

CAMERA = ["--camera", "60", "61", "30", "25"]


@pytest.fixture
def pair(tmp_path):
    """Pictures of two views with poses; returns the words of `prepare` but the baseline."""
    for side in ("left", "right"):
        files(tmp_path / "raw", side, map(scene_picture, range(3)))
    lines = [f"{i} {0.1 * i} 0 0 0 0 0 1" for i in range(3)]
    (tmp_path / "poses.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "out")]
    return [*words, "--trajectory", str(tmp_path / "poses.txt")]


@pytest.mark.parametrize("stated", ["--baseline", "--calibration"])
def test_an_arbitrary_unit_of_the_positions_beside_a_baseline_is_refused(tmp_path, pair, stated, capsys):
    (tmp_path / "a.ini").write_text(ini(), encoding="utf-8")
    words = [*pair, "--baseline", "4", *CAMERA] if stated == "--baseline" else [*pair, stated, str(tmp_path / "a.ini")]
    assert main([*words, "--trajectory-unit", "arbitrary"]) == 2
    said = capsys.readouterr().err
    assert "--trajectory-unit arbitrary" in said and "baseline in millimetres" in said and "endotsr poses" in said
    assert main([*words, "--trajectory-unit", "mm"]) == 0
    assert read_sequence_file(tmp_path / "out").unit == "mm"


def test_an_arbitrary_unit_of_the_depth_beside_a_baseline_is_refused(tmp_path, pair, capsys):
    files(tmp_path, "depth", [scene_picture(i)[:, :, 0] for i in range(3)])
    words = [*pair[:4], *CAMERA, "--depth", str(tmp_path / "depth"), "--depth-unit", "arbitrary", "--trust-depth"]
    assert main([*words, "--baseline", "4"]) == 2
    assert "--depth-unit arbitrary" in capsys.readouterr().err
    assert main(words) == 0 and read_sequence_file(tmp_path / "out").unit == "arbitrary"


def test_the_baseline_of_a_file_is_left_out_without_right_pictures(tmp_path, pair, capsys):
    """A matrix with a baseline beside the pictures and the poses of one camera: nothing needs the baseline."""
    (tmp_path / "K.txt").write_text("60 0 30 0 61 25 0 0 1\n0.004\n", encoding="utf-8")
    words = [*pair, "--calibration", str(tmp_path / "K.txt"), "--trajectory-unit", "arbitrary"]
    words[1] = str(tmp_path / "raw/left")
    assert main(words) == 0
    assert "baseline of 4 mm left out" in capsys.readouterr().out
    assert read_sequence_file(tmp_path / "out").camera.baseline == 0


def test_a_folder_whose_file_states_one_arbitrary_unit_is_read(tmp_path):
    """There the baseline is in the unit of the poses."""
    written(tmp_path / "clip", right=True, poses=moving(), unit="arbitrary", depth=False)
    assert main(["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "out")]) == 0
    assert read_sequence_file(tmp_path / "out").camera.baseline == 4
