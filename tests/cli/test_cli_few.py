"""One frame, one picture, one file: the words of the messages, and what comes after a clip that is too short."""

import re

import pytest
from common_folder import written
from tiny import scene

from endotsr.cli.main import main

ONE_OF_MANY = re.compile(r"\b1 (?!less|ms|s\b)[a-z]+s\b")
TOO_SHORT = "no training: {} too few: at least 3 are needed; prepare more frames of its source"


def said(capsys, *words) -> str:
    """What a command said."""
    capsys.readouterr()
    main([*map(str, words)])
    out, err = capsys.readouterr()
    return out + err


def test_no_message_says_1_frames(finished_run, tmp_path, capsys):
    clip, out = tmp_path / "clip", tmp_path / "o"
    written(clip)
    small = ("--width", "48", "--height", "32", "--frames", "4")
    lines = {
        "prepare": said(capsys, "prepare", clip, "--out", tmp_path / "one", "--frames", "0:1"),
        "check": said(capsys, "check", tmp_path / "one"),
        "depth": said(capsys, "depth", tmp_path / "one", "--flat", "--replace"),
        "again": said(capsys, "prepare", tmp_path / "one", "--out", tmp_path / "two", "--frames", "3"),
        "draw": said(capsys, "masks", tmp_path / "one", "--draw", tmp_path / "a.html"),
        "pictures": said(capsys, "render", finished_run, "--out", out, "--times", "0.5"),
        "film": said(capsys, "render", finished_run, "--film", tmp_path / "a.gif", "--times", "0.5"),
        "files": said(capsys, "export", finished_run, "--out", tmp_path / "files", "--count", "1"),
        "points": said(capsys, "export", finished_run, "--out", tmp_path / "a.glb", "--times", "0.5"),
        "simulated": said(capsys, "simulate", "still", "--out", tmp_path / "s", *small),
    }  # fmt: skip
    assert {name: ONE_OF_MANY.findall(text) for name, text in lines.items() if ONE_OF_MANY.search(text)} == {}
    assert "written: " in lines["prepare"] and "1 frame of 32x24" in lines["prepare"] and "1 picture" in lines["film"]
    assert "1 frame is too few" in lines["check"] and "1 picture in" in lines["pictures"]
    assert "1 file of gaussians" in lines["files"] and "at 1 time," in lines["points"]


@pytest.mark.parametrize(("frames", "named"), [("0:1", "1 frame is"), ("0:2", "2 frames are")])
def test_a_clip_that_is_too_short_for_a_training_is_told_so_where_one_comes_next(frames, named, tmp_path, capsys):
    clip = tmp_path / "clip"
    lines = said(capsys, "prepare", scene(), "--out", clip, "--frames", frames).splitlines()
    assert lines[-1] == TOO_SHORT.format(named) and "endotsr train" not in "\n".join(lines)
    checked = said(capsys, "check", clip)
    assert "refused" in checked.splitlines()[-1] and f": {named} too few: at least 3 are needed; " in checked
    lines = said(capsys, "depth", clip, "--flat", "--replace").splitlines()
    assert lines[-1] == TOO_SHORT.format(named)
    assert said(capsys, "prepare", scene(), "--out", tmp_path / "three", "--frames", "0:3").splitlines()[-1] == (
        f"next: endotsr train {tmp_path / 'three'} --out RUN"
    )


def test_pictures_that_are_too_small_for_a_training_are_named(tmp_path, capsys):
    lines = said(capsys, "prepare", scene(), "--out", tmp_path / "clip", "--crop", "0", "0", "40", "14").splitlines()
    words = "images of 40x14 pixels; use at least 16 on each side"
    assert lines[-1] == f"no training: {words}; prepare larger ones"
    assert f"{words}; " in said(capsys, "check", tmp_path / "clip"), "as check says"
