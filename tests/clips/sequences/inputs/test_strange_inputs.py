"""What the checks of `strange_inputs.py` say of right inputs: nothing."""

import numpy as np
import pytest
from common_folder import written
from depth_folders import true_depth
from strange_inputs import given, keys, matched, textured

from endotsr.cli.main import main
from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.prepare.lens import folded_fraction
from endotsr.clips.prepare.stated_depth import bytes_exchanged
from endotsr.clips.sequences.checks.cameras import intrinsics_findings
from endotsr.clips.sequences.checks.depth import depth_facts, depth_findings
from endotsr.clips.sequences.checks.frames import rate_findings


@pytest.mark.parametrize(("size", "centre", "said"), [
    ((640, 512), (320.0, 256.0), False), ((640, 512), (256.0, 320.0), True), ((1280, 1024), (560.0, 540.0), False),
    ((1280, 1024), (540.0, 610.0), True), ((1920, 1080), (872.0, 472.0), False), ((512, 512), (190.0, 256.0), False),
])  # fmt: skip
def test_exchanged_numbers_of_the_principal_point_are_named(size, centre, said):
    found = intrinsics_findings(Intrinsics(569.0, 569.0, *centre, *size), "here")
    assert ["exchanged" in finding.what for finding in found] == [True] * said


def test_a_lens_model_turns_back_where_its_derivative_is_zero():
    matrix = np.array([[100.0, 0, 64], [0, 100, 48], [0, 0, 1]])
    radius = np.hypot(*np.meshgrid(np.arange(128) - 64, np.arange(96) - 48)) / 100
    for k1 in (-0.9, -0.6):
        expected = (radius > np.sqrt(-1 / (3 * k1))).mean()  # 1 + 3 k1 r^2 = 0
        assert folded_fraction(matrix, np.array([k1, 0, 0, 0]), 128, 96) == pytest.approx(expected, abs=5e-3)
    for right in ([-0.3, 0.1, 0, 0], [0.2, 0, 0, 0, 0.1], [-0.4, 0.2, 0, 0, 0, 0.1, 0, 0], [0, 0, 0.9, 0.9]):
        assert folded_fraction(matrix, np.array(right), 128, 96) == 0


@pytest.mark.parametrize("rate", [0.1, 1.0, 25.0, 59.94, 1000.0])
def test_the_rates_of_cameras_are_not_named(rate):
    assert rate_findings(np.arange(6) * (1 / rate), None, "here") == rate_findings(None, rate, "here") == []
    assert rate_findings(None, None, "here") == []


def test_planes_that_differ_are_not_called_one():
    def codes(planes) -> list[str]:
        facts = [depth_facts(f"{i}", plane, plane, None) for i, plane in enumerate(planes)]
        return [found.code for found in depth_findings(facts, "here", False, 0.2)]

    planes = [true_depth(i).astype(np.float32) for i in range(6)]
    assert codes(planes) == [] and codes([*planes, planes[-1]]) == []
    assert codes([planes[i // 3] for i in range(6)]) == ["still-depth"]


@pytest.mark.parametrize("scale", [10, 100, 256])
def test_the_bytes_of_right_depth_are_not_exchanged(scale):
    stored = np.round(true_depth(0) * scale).astype(np.uint16)
    assert not bytes_exchanged(stored.astype(np.float32))
    assert bytes_exchanged(stored.byteswap().astype(np.float32))


@pytest.mark.parametrize("make", [given(1), matched(lambda i: textured(i, 12)), keys(255, 0)])
def test_right_inputs_of_the_commands_give_no_warning(make, tmp_path, capsys):
    words = make(tmp_path)
    capsys.readouterr()
    assert main(words) == 0
    assert "warning" not in capsys.readouterr().out


def test_a_broken_sequence_file_says_nothing_of_the_folders_beside_it(tmp_path, capsys):
    written(tmp_path)
    file = tmp_path / "sequence.toml"
    file.write_text(file.read_text().replace("fx =", "focal ="))
    assert main(["check", str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "sequence-file" in said and "not-read" not in said


def test_a_size_that_the_pictures_do_not_have_is_an_error_of_the_file(tmp_path, capsys):
    written(tmp_path, masks=False, depth=False)
    for file in (tmp_path / "images").iterdir():
        write_png(file, read_png(file)[:20])
    main(["check", str(tmp_path)])
    said = capsys.readouterr().out
    assert "states 32x24, the pictures have 32x20; sequence.toml" in said and "correct the poses" not in said
