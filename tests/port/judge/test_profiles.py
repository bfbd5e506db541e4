"""Profiles: a port of one part claims this part, in words; a part with a gap or a mistake claims less."""

import re
import shutil
from typing import get_args

import numpy as np
import pytest
from made_up_ports import short_version, write_expected

from endotsr.cli import golden as golden_command
from endotsr.cli.golden import run
from endotsr.errors import InputError
from endotsr.port.judge.command import write_requests
from endotsr.port.judge.npy import npy_bytes, read_plain
from endotsr.port.judge.profiles import PROFILES, complete_level, of_profile
from endotsr.port.judge.report import as_table
from endotsr.port.judge.verdict import asked_of, judge

CLAIMS = {name: max(profile.says) for name, profile in PROFILES.items()}


@pytest.fixture
def answered(reference_answers):
    return reference_answers("float32")


@pytest.fixture
def port(answered, tmp_path):
    """A copy of the outputs, to take something away."""
    return shutil.copytree(answered, tmp_path / "port")


def said(report):
    return {one.profile: one.level for one in report.profiles}


def test_the_command_takes_every_profile():
    assert get_args(golden_command.Profile) == ("", *PROFILES)


def test_every_operation_of_a_profile_has_cases_and_training_has_all_but_the_options(golden):
    operations = {case.operation for case in golden.cases}
    for profile in PROFILES.values():
        assert set(profile.operations) <= operations
    options = {case.operation for case in golden.cases if re.fullmatch(r"B1[3-9]|B[2-9]\d", case.equation)}
    assert operations - set(PROFILES["training"].operations) == options, "B13 and above are options of this package"


def test_a_whole_port_claims_every_profile(golden, answered):
    report = judge(golden, answered, "float32", again=answered)
    assert said(report) == CLAIMS
    assert "  renderer (forward), level 3: colour, depth and opacity images" in as_table(report).splitlines()
    assert said(judge(golden, answered, "float32", level=2)) == {
        "renderer-forward": 1, "renderer": 2, "losses": 2, "optimiser": 1, "method": 2,
    }  # fmt: skip


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_alone_has_its_last_level(golden, answered, name):
    report = judge(golden, answered, "float32", profile=name, again=answered)
    assert report.passed and report.level == CLAIMS[name] and said(report) == {name: CLAIMS[name]}
    assert report.claim == f"golden {short_version(golden)}, {PROFILES[name].title}, level {report.level}, float32"


def test_a_forward_renderer_claims_its_images(golden, port):
    """Without the profile it has level 1; with the word `reverse` in not_ported.txt nothing is missing."""
    for file in port.rglob("d_*.npy"):
        file.unlink()
    for case in golden.cases:
        if case.operation not in PROFILES["renderer-forward"].operations:
            shutil.rmtree(port / case.name, ignore_errors=True)
    report = judge(golden, port, "float32", profile="renderer-forward")
    assert report.passed and report.claim.endswith("renderer (forward), level 3, float32")
    rest = {case.operation for case in golden.cases} - set(PROFILES["renderer-forward"].operations)
    (port / "not_ported.txt").write_text("\n".join([*rest, "reverse"]))
    report = judge(golden, port, "float32", level=3)
    assert (said(report) == {"renderer-forward": 3, "renderer": 1} and not report.accepted) or report.level == 1
    assert report.claim.endswith(", reverse passes") and len(report.notes) == 1
    assert report.notes[0].count("--profile") == 1, "the other profiles have reverse passes"
    assert (
        "level 2 asks for gradients" in report.notes[0] and "ends at 1; --profile renderer-forward" in report.notes[0]
    )
    assert report.notes[0] in as_table(report)
    assert judge(golden, port, "float32", level=1).notes == []
    (port / "not_ported.txt").write_text("\n".join([*rest, "reverse", "harmonics"]))  # and so without this profile
    (note,) = judge(golden, port, "float32", level=3).notes
    assert "level 2 asks for gradients" in note and "--profile" not in note
    (port / "not_ported.txt").write_text("\n".join([*rest, "reverse"]))
    assert not judge(golden, port, "float32", profile="renderer").passed


@pytest.mark.parametrize(("name", "level"), [("renderer-forward", 2), ("optimiser", 0), ("training", 4)])
def test_a_level_that_a_profile_has_no_output_of_is_passed_over(golden, tmp_path, name, level):
    """Before, level 2 of the forward renderer was never complete."""
    write_expected(golden, golden.cases, tmp_path)
    report = judge(golden, tmp_path, "float32", profile=name, level=level)
    assert report.passed and report.level == min(level, 1) + 3 * (name == "training")
    (tmp_path / "reading" / "layout" / "flat.npy").unlink()
    assert not judge(golden, tmp_path, "float32", profile=name, level=level).passed


def test_losses_alone(golden, port):
    rest = {case.operation for case in golden.cases} - set(PROFILES["losses"].operations)
    (port / "not_ported.txt").write_text("\n".join(rest))
    assert said(judge(golden, port, "float32")) == {"losses": 2}


def test_a_wrong_output_lowers_the_profiles_that_have_it(golden, port):
    path = next((port / "masked_ssim").rglob("d_rendered.npy"))
    path.write_bytes(npy_bytes(-read_plain(path)))
    found = said(judge(golden, port, "float32", level=4))
    assert found == {"renderer-forward": 3, "renderer": 3, "losses": 1, "optimiser": 1, "method": 1}


def test_a_port_without_the_exposure_or_with_a_wrong_one_keeps_every_profile(golden, port):
    """No profile has this option, so its cases of `objective` and `training` count in none."""
    path = port / "objective" / "exposed" / "d_position.npy"
    path.write_bytes(npy_bytes(-read_plain(path)))
    report = judge(golden, port, "float32", again=port)
    assert report.level == 2 and said(report) == CLAIMS
    (port / "not_ported.txt").write_text("exposure")
    report = judge(golden, port, "float32", again=port)
    assert report.passed and report.claim.endswith("level 5, float32, without exposure") and said(report) == CLAIMS


def test_requests_of_a_profile_ask_for_its_outputs_alone(golden, tmp_path):
    asked, level = asked_of(golden, "", "renderer-forward", 5)
    write_requests(asked, tmp_path, "float32", level)
    text = "".join(path.read_text() for path in tmp_path.rglob("request.json"))
    assert level == 3 and '"colour_image"' in text and '"operation": "render"' in text and '"d_position"' not in text


def test_only_needles_are_told_with_their_size_and_the_rewrite(golden, port):
    folder = port / "render" / "long_needle"
    for name in ("colour_image", "d_log_scale"):
        array = np.array(read_plain(folder / f"{name}.npy"))
        (folder / f"{name}.npy").write_bytes(npy_bytes(array * np.float32(1.5)))
    lines = as_table(judge(golden, port, "float32", level=3)).splitlines()
    assert lines[0].startswith("only needles fail: render/long_needle, ")
    assert "times the tolerance (colour_image, d_log_scale)" in lines[0] and "page (B3)" in lines[1]
    path = port / "motion" / "generic" / "translation.npy"
    path.write_bytes(npy_bytes(-read_plain(path)))
    assert "only needles" not in as_table(judge(golden, port, "float32", level=3))


def test_levels_without_outputs_count_in_a_profile_alone():
    counts = {0: (1, 1), 1: (2, 2), 2: (0, 0), 3: (4, 4), 4: (0, 0)}
    assert (complete_level(counts), complete_level(counts, gaps=True)) == (1, 3)
    assert complete_level({0: (1, 2), 1: (2, 2)}, gaps=True) == -1


def test_an_unknown_profile_is_refused(golden, answered):
    with pytest.raises(InputError, match="no such profile; use one of renderer-forward"):
        of_profile(golden.cases, "viewer")
    with pytest.raises(InputError, match="motion is no part"):
        judge(golden, answered, "float32", profile="renderer", only="motion")
    with pytest.raises(InputError):
        run(["judge", str(answered), "--profile", "viewer"])
