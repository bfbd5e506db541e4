"""`-q`, `--log-file`, the short and the whole help, and completion scripts."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tiny import assert_refused

from endotsr.cli.main import COMMANDS, main
from endotsr.cli.parts.completion import ALWAYS, SCRIPTS, words_of
from endotsr.cli.parts.fields import fields_of
from endotsr.cli.parts.output import OutputOptions, split_output
from endotsr.cli.train import TrainOptions
from endotsr.config import DEMO


def test_quiet_prints_nothing_but_errors(capsys):
    assert main(["-q", "render", "--help"]) == 0 and capsys.readouterr().out == ""
    assert main(["render", "--quiet"]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("endotsr: error: ") and said.err.count("\n") == 1


@pytest.mark.parametrize("quiet", [[], ["-q"]])
def test_a_log_file_gets_what_is_printed_and_errors(quiet, tmp_path, capsys):
    file = tmp_path / "a.log"
    assert main([*quiet, "--log-file", str(file), "render", "--help"]) == 0
    assert "usage: endotsr render" in file.read_text()
    assert ("usage: endotsr render" in capsys.readouterr().out) == (not quiet)
    assert main(["render", f"--log-file={file}", *quiet]) == 2
    assert file.read_text() == capsys.readouterr().err, "written from its beginning"


def test_a_log_file_that_cannot_be_written_is_refused(tmp_path, capsys):
    assert_refused(capsys, ["--log-file", str(tmp_path / "no" / "a.log"), "render"], "a.log: cannot be written")
    assert_refused(capsys, ["render", "--log-file"], "--log-file: missing value FILE")
    for other in (["--json", "a.txt"], ["--json=a.txt"], ["a.txt"]):
        assert_refused(capsys, ["check", "--log-file", "a.txt", *other], "a.txt: the command names this file elsewhere")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is a device of Linux")
@pytest.mark.parametrize("quiet", [[], ["-q"]])
def test_a_log_on_a_full_disk_ends_with_one_warning_and_the_command_goes_on(quiet, capsys):
    assert main([*quiet, "--log-file", "/dev/full", "render", "--help"]) == 0
    said = capsys.readouterr()
    assert ("usage: endotsr render" in said.out) == (not quiet)
    assert said.err == "endotsr: warning: /dev/full: the disk is full; the log ends here, the command goes on\n"


PRINTS = (["--help"], ["--version"], ["--completion", "bash"], ["check", "--help"], ["golden", "judge", "--help"])


def code_and_errors(words, output, unbuffered, errors=subprocess.PIPE, module="endotsr"):
    """Exit code and standard error of a process of its own, whose exit writes what is left in its buffers."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"} | unbuffered
    command = [sys.executable, "-m", module, *words]
    done = subprocess.run(command, stdout=output, stderr=errors, env=environment, text=True, timeout=300)
    return done.returncode, done.stderr


@pytest.fixture
def left_by_its_reader():
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


@pytest.mark.skipif(os.name != "posix", reason="closes the reading end of a pipe")
@pytest.mark.parametrize("words", [["docs/make.py"], ["tests/house.py"], ["tests/after.py", "HEAD"]], ids=" ".join)
def test_a_closed_pipe_ends_a_program_of_the_repository_without_a_traceback(words, left_by_its_reader):
    command = [sys.executable, Path(__file__).parents[2] / words[0], *words[1:]]
    done = subprocess.run(command, stdout=left_by_its_reader, stderr=subprocess.PIPE, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(os.name != "posix", reason="closes the reading end of a pipe")
@pytest.mark.parametrize("unbuffered", [{}, {"PYTHONUNBUFFERED": "1"}], ids=["buffered", "unbuffered"])
def test_a_closed_pipe_ends_a_command_without_a_traceback(unbuffered, left_by_its_reader):
    for words in PRINTS:
        assert code_and_errors(words, left_by_its_reader, unbuffered) == (141, ""), words
    for module in ("definition", "port.judge"):  # -13: the signal itself ends a program of numbers
        words = ["--help"] if module == "port.judge" else []
        code, said = code_and_errors(words, left_by_its_reader, unbuffered, module=f"endotsr.{module}")
        assert (code, said) == (-13, ""), module
    refused = ["check", "no such folder"]
    assert code_and_errors(refused, left_by_its_reader, unbuffered, left_by_its_reader) == (2, None)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is a device of Linux")
@pytest.mark.parametrize("unbuffered", [{}, {"PYTHONUNBUFFERED": "1"}], ids=["buffered", "unbuffered"])
def test_a_full_disk_under_the_output_ends_a_command_in_one_line(unbuffered):
    with Path("/dev/full").open("w") as full:
        for words in PRINTS:
            expected = (2, "endotsr: error: the disk is full\n")
            assert code_and_errors(words, full, unbuffered) == expected, words


BUSY = """
import sys, threading, time
import cv2, numpy as np
from endotsr.cli import check, main

picture = np.random.default_rng(0).integers(0, 255, (600, 600), np.uint8)

def flows():
    method = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    while True:
        method.calc(picture, picture, None)

def interrupted(words):
    print("said before")
    threading.Thread(target=flows, daemon=True).start()
    time.sleep(0.3)
    raise KeyboardInterrupt

check.run = interrupted
sys.argv = ["endotsr", "check", "x"]
sys.exit(main.main())
"""


def test_an_interruption_with_a_thread_in_opencv_ends_the_process_as_any_other():
    """It aborted: "terminate called without an active exception", exit code 134."""
    done = subprocess.run([sys.executable, "-c", BUSY], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (130, "said before\n", "\nendotsr: interrupted\n")


def test_no_output_replaces_a_recording_a_clip_or_a_run(run_copy, tmp_path, capsys):
    recording, clip = tmp_path / "a.mp4", tmp_path / "sequence.toml"
    recording.write_bytes(b"\0\0\0 ftypisom")
    clip.write_text("frames = 3")
    for words in (["prepare", "--log-file", str(recording)], ["check", "clip", "--json", str(recording)]):
        assert_refused(capsys, words, "a.mp4: would be replaced, but is no text file")
    for words in (["prepare", "--log-file", str(clip)], ["check", "clip", "--html", str(clip)]):
        assert_refused(capsys, words, "sequence.toml: would be replaced, but other commands read it")
    checkpoint = run_copy / "checkpoint.npz"
    before = recording.read_bytes(), clip.read_bytes(), checkpoint.read_bytes()
    assert_refused(capsys, ["export", str(run_copy), "--out", str(checkpoint)], "checkpoint.npz: would be replaced")
    assert_refused(capsys, ["evaluate", str(run_copy), "--json", str(run_copy / "run.json")], "run.json: would be")
    assert (recording.read_bytes(), clip.read_bytes(), checkpoint.read_bytes()) == before
    assert main(["evaluate", str(run_copy), "--no-view", "--json", str(tmp_path / "run.json")]) == 0, "of no run"


def test_two_options_do_not_name_one_file(tmp_path, capsys):
    words = ["check", "clip", "--json", f"{tmp_path}/a", "--html", f"{tmp_path}/../{tmp_path.name}/a"]
    assert_refused(capsys, words, "--html ", "a: is also the file of --json")


def test_other_words_keep_their_order():
    output, words = split_output(["train", "x", "-q", "--out", "y", "--log-file=z", "--seed", "-1"])
    assert words == ["train", "x", "--out", "y", "--seed", "-1"] and output.quiet and output.log_file.name == "z"
    assert split_output(["a"]) == (OutputOptions(), ["a"])


def test_the_short_help_is_short_and_names_the_whole_one(capsys):
    assert main(["train", "--help"]) == 0
    short = capsys.readouterr().out
    assert main(["train", "--help-all"]) == 0
    whole = capsys.readouterr().out
    options = [line.split()[0] for line in short.splitlines() if line.startswith("  -")]
    assert 15 <= len(options) <= 28 and "--iterations" in options and "--model.[no-]appearance" in options
    hidden = len(fields_of(TrainOptions)) - sum(field.name in short or field.off in short for field in
                                                fields_of(TrainOptions))  # fmt: skip
    assert "--model.bases" not in short and "--model.bases" in whole and hidden > 50
    assert "`endotsr train --help-all` lists" in short and "--help-all` lists" not in whole


def test_the_whole_help_of_demo_names_no_sequence_and_its_own_defaults(capsys):
    assert main(["demo", "--help-all"]) == 0
    whole = capsys.readouterr().out
    assert "--model.bases" in whole and "SEQUENCE [OPTIONS]" not in whole and "arguments:" not in whole
    assert "  --windows" not in whole and "with --windows:" not in whole
    assert whole.startswith("usage: endotsr demo") and "Simulate a sequence" in whole
    length = whole.partition("--training.iterations INT")[2].partition("--")[0]
    assert f"default: {DEMO.training.iterations})" in length


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_both_helps(name, capsys):
    for word in ("-h", "--help", "--help-all"):
        assert main([name, word]) == 0
        assert capsys.readouterr().out.startswith(f"usage: endotsr {name}")


def test_every_command_has_words_of_its_own():
    assert [name for name in COMMANDS if len(words_of(name)) <= len(ALWAYS)] == []


@pytest.mark.parametrize("shell", SCRIPTS)
def test_a_script_names_every_command_and_its_options(shell, capsys):
    assert main(["--completion", shell]) == 0
    script = capsys.readouterr().out
    for name in COMMANDS:
        assert name in script
        for word in words_of(name):
            assert word.removeprefix("--") in script
    assert "model.bases" in script and "--film" in words_of("render")
    assert_refused(capsys, ["--completion", "tcsh"], "'tcsh' is not allowed; use one of bash, zsh, fish")


@pytest.mark.parametrize(
    ("line", "expected"),
    [("endotsr ren", "render"), ("endotsr render run --fi", "--film"), ("endotsr golden ju", "judge")],
)
def test_bash_completes(line, expected):
    if shutil.which("bash") is None:
        pytest.skip("no bash")
    words = line.split()
    script = (
        SCRIPTS["bash"]()
        + f"""
COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _endotsr; echo "${{COMPREPLY[@]}}"
"""
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=30)
    assert done.stdout.split() == [expected] and done.stderr == ""


def test_the_readme_and_the_overview_list_every_command(capsys):
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `endotsr ([a-z]+)` \|", readme, re.MULTILINE) == [*COMMANDS]
    for words in (["--help"], []):
        assert main(words) == 0
        assert re.findall(r"^  ([a-z]+)  ", capsys.readouterr().out, re.MULTILINE) == [*COMMANDS]


def test_every_first_word_completes():
    assert "--precisions" in words_of("bench") and "judge" in words_of("golden")
    assert "moving-camera" in words_of("simulate") and "--stereo" in words_of("prepare")
