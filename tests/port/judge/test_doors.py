"""The reference goes through the doors of a port: a folder of outputs, and a command called with requests."""

import json
import re
import shlex
import shutil
import sys

import numpy as np
import pytest
from made_up_ports import case_of, short_version

from endotsr.cli.golden import run
from endotsr.errors import InputError
from endotsr.port.judge.__main__ import main
from endotsr.port.judge.command import words_of
from endotsr.port.judge.npy import npy_bytes, read_plain
from endotsr.port.judge.report import as_table
from endotsr.port.judge.verdict import judge

REFERENCE = f"{sys.executable} -m endotsr.cli.main golden reference {{outputs}} --requests {{requests}}"


@pytest.fixture(scope="module", params=["float64", "float32"])
def answered(request, reference_answers):
    return request.param, reference_answers(request.param)


def test_the_reference_passes_every_level(golden, answered):
    precision, folder = answered
    report = judge(golden, folder, precision, again=folder)
    refused = [(c.name, o.name, o.reason) for c in report.cases for o in c.outputs if o.status != "passed"]
    assert report.passed and not refused, refused[:5]
    assert report.claim == f"golden {short_version(golden)}, level 5, {precision}"


def test_single_precision_does_not_pass_as_double(golden, answered):
    precision, folder = answered
    report = judge(golden, folder, "float64", again=folder)
    assert report.passed == (precision == "float64")


def test_the_claim_is_the_highest_complete_level(golden, answered):
    precision, folder = answered
    path = folder / "dictionary" / "generic" / "d_omega.npy"
    kept = path.read_bytes()
    try:
        path.write_bytes(npy_bytes(-read_plain(path)))
        report = judge(golden, folder, precision, level=4)
        assert report.level == 1 and not report.passed and judge(golden, folder, precision, level=1).passed
    finally:
        path.write_bytes(kept)


def test_what_a_port_leaves_out_stands_in_its_claim(golden, answered):
    precision, folder = answered
    note, motion = folder / "not_ported.txt", folder / "motion"
    moved = motion.rename(folder / "motion_away")
    try:
        assert judge(golden, folder, precision).level == 0
        note.write_text("# to do\nmotion  # equation (3)\n")
        report = judge(golden, folder, precision, again=folder)
        assert report.passed and report.claim.endswith(f"level 5, {precision}, without motion")
        note.write_text("motion\nrender\nobjective\n")
        report = judge(golden, folder, precision)
        assert report.level == 2 and report.claim.endswith(f"level 2, {precision}, without motion")
    finally:
        moved.rename(motion)
        note.unlink(missing_ok=True)


def test_bits_that_change_between_runs_stop_level_5(golden, answered, tmp_path):
    precision, folder = answered
    if precision == "float64":
        report = judge(golden, folder, precision, again=tmp_path)
        assert report.level == 4


def test_exit_codes_and_report_files(golden, answered, tmp_path, capsys):
    precision, folder = answered
    second = shutil.copytree(folder, tmp_path / "second")
    words = ["judge", str(folder), "--precision", precision, "--again", str(second)]
    page, data = tmp_path / "r.html", tmp_path / "r.json"
    assert run([*words, "--html", str(page), "--json", str(data)]) == 0
    assert f"level 5, {precision}" in capsys.readouterr().out
    assert page.read_text().startswith("<!doctype html>") and data.stat().st_size > 1000
    assert run(["judge", str(tmp_path)]) == 1
    with pytest.raises(InputError):
        run(["judge", str(tmp_path / "nothing")])
    with pytest.raises(InputError):
        run(["judje"])


@pytest.mark.parametrize("door", [run, main])
def test_one_folder_is_not_two_runs(tmp_path, capsys, door):
    """Before, the first run was compared with itself and had level 5; below level 5 the second run had no effect."""
    other = tmp_path / "other"
    other.mkdir()
    words = ["judge", str(tmp_path), "--again"]
    for more, reason in (
        ([str(other / "..")], "is OUTDIR itself"),
        ([str(other), "--level", "4"], "level 4 is asked; leave it out"),
        ([str(other), "--profile", "losses"], "level 2 is asked; leave it out"),
        ([str(tmp_path / "none")], "none: not a folder"),
    ):
        try:
            assert door([*words, *more]) == 2
            said = capsys.readouterr().err
        except InputError as error:
            said = str(error)
        assert reason in said


def test_a_command_is_called_with_requests_alone(golden, tmp_path, capsys):
    code = run(["run", "--port", REFERENCE, "--level", "2", "--precision", "float32", "--keep", str(tmp_path)])
    assert code == 0 and "level 2, float32" in capsys.readouterr().out
    assert not list((tmp_path / "requests").rglob("expected*"))
    request = (tmp_path / "requests" / "motion" / "generic" / "request.json").read_text()
    assert "compare" not in request and "mistakes" not in request


def test_a_port_that_fails_gets_verdicts(tmp_path, capsys):
    assert run(["run", "--port", f"{sys.executable} -c 1/0 {{requests}} {{outputs}}", "--level", "0"]) == 1
    assert "ended with code 1" in capsys.readouterr().out
    with pytest.raises(InputError, match="requests"):
        run(["run", "--port", "true"])
    with pytest.raises(InputError, match="started"):
        run(["run", "--port", "no-such-program {requests} {outputs}"])


def test_outputs_of_an_earlier_port_are_not_judged(tmp_path, capsys):
    words = ["run", "--level", "0", "--keep", str(tmp_path / "kept"), "--port"]
    assert run([*words, REFERENCE]) == 0 and "level 0, float32" in capsys.readouterr().out
    assert run([*words, f"{sys.executable} -c 0 {{requests}} {{outputs}}"]) == 1
    said = capsys.readouterr().out
    assert said.endswith("no level is complete\n") and " 0 of 18 outputs" in said
    assert not list((tmp_path / "kept" / "outputs").iterdir())


def test_a_port_that_answers_and_then_fails_has_no_claim(tmp_path, capsys):
    script = tmp_path / "port.py"
    script.write_text("import sys\nfrom endotsr.cli.main import main\nsys.exit(main(sys.argv[1:]) + 3)\n")
    port = f"{sys.executable} {script} golden reference {{outputs}} --requests {{requests}}"
    report = tmp_path / "report.json"
    assert run(["run", "--level", "0", "--port", port, "--json", str(report)]) == 1
    said = capsys.readouterr().out
    assert "18 of 18 outputs" in said and said.endswith("no claim: the port ended with code 3\n")
    assert json.loads(report.read_text())["level"] == -1


@pytest.mark.parametrize("name", ["requests", "outputs", "outputs_again"])
def test_foreign_files_in_the_kept_folder_stay(name, tmp_path):
    mine = tmp_path / name / "mine.txt"
    mine.parent.mkdir()
    mine.write_text("mine")
    with pytest.raises(InputError, match=f"{name} was not made by .*use a folder without requests, outputs"):
        run(["run", "--level", "0", "--keep", str(tmp_path), "--port", "true {requests} {outputs}"])
    assert mine.read_text() == "mine" and [path.name for path in tmp_path.iterdir()] == [name]


def test_a_refusal_like_no_known_mistake_says_so_and_shows_the_difference(golden, tmp_path):
    folder = tmp_path / "motion" / "generic"
    folder.mkdir(parents=True)
    off = golden.array(case_of(golden, "motion/generic"), "expected/translation.npy").copy()
    off[1, 2] += 5e-12
    (folder / "translation.npy").write_bytes(npy_bytes(off))
    lines = as_table(judge(golden, tmp_path, "float64", level=1, only="motion")).splitlines()
    assert next(s for s in lines if s.startswith("motion/generic")).endswith("refused: not explained")
    assert lines[1] == "looks like none of the known mistakes"
    assert not [line for line in lines if line == "looks like:" or "made for" in line]
    (line,) = [line for line in lines if "motion/generic/translation" in line]
    ((got, right, difference),) = re.findall(r"at \[1, 2\] (\S+), expected (\S+): off by (\S+)", line)
    assert got != right and float(difference) == pytest.approx(5e-12, rel=1e-2)
    assert "times what is allowed" in line


def test_difference_images_stand_in_the_page(golden, answered, tmp_path):
    precision, folder = answered
    path = folder / "render" / "paper" / "colour_image.npy"
    kept = path.read_bytes()
    try:
        path.write_bytes(npy_bytes(np.array(read_plain(path)[:, ::-1])))
        page = tmp_path / "page.html"
        assert run(["judge", str(folder), "--precision", precision, "--html", str(page), "--search", "0"]) == 1
        assert page.read_text().count("data:image/png;base64,") == 3
    finally:
        path.write_bytes(kept)


def test_level_5_requires_a_second_run(golden, answered):
    precision, folder = answered
    report = judge(golden, folder, precision)
    assert report.level == 4 and report.claim == f"golden {short_version(golden)}, level 4, {precision}"
    assert "determinism/again: second run" in as_table(report)


def test_one_family_or_case_is_judged_alone_and_without_a_claim(golden, answered, tmp_path, capsys):
    precision, folder = answered
    for only, count in (("motion", 2), ("masked_l1", 7), ("masked_l1/equal", 1)):
        report = judge(golden, folder, precision, level=4, only=only)
        assert len(report.cases) == count and report.claim == f"no claim: only {only} was judged"
    words = ["judge", str(folder), "--precision", precision, "--level", "1", "--only"]
    assert run([*words, "motion"]) == 0 and capsys.readouterr().out.endswith("no claim: only motion was judged\n")
    with pytest.raises(InputError, match="no such case; use one of reading, "):
        run([*words, "no_family"])
    assert run(["run", "--port", REFERENCE, "--level", "2", "--only", "matern", "--keep", str(tmp_path / "kept")]) == 0
    assert [p.name for p in (tmp_path / "kept" / "requests").iterdir() if p.is_dir()] == ["matern"]


def test_failures_alone_are_listed_with_the_level_that_they_stop(golden, answered, tmp_path):
    """A gradient is refused and two outputs are missing: the case stands in the way of level 2, of none below."""
    precision, folder = answered
    case = next(c for c in golden.cases if c.name == "matern/short")
    target = tmp_path / case.name
    target.mkdir(parents=True)
    for name in ("rho", "penalty", "d_motion_coefficients"):
        value = read_plain(folder / case.name / f"{name}.npy")
        (target / f"{name}.npy").write_bytes(npy_bytes(value if name != "d_motion_coefficients" else 7 * value))
    lines = as_table(judge(golden, tmp_path, precision, level=2, only="matern")).splitlines()
    assert lines[0].startswith("first wrong: operation matern, equation (4), level 2, d_motion_coefficients alone")
    lines = lines[lines.index("") + 1 :]
    assert lines[1].split()[:3] == ["matern/published", "1", "0/3"] and "matern/short" in lines[2]
    assert lines[2].split()[1:3] == ["2", "2/3"]
    assert "  matern/published: rho, penalty, d_motion_coefficients" in lines
    whole = as_table(judge(golden, folder, precision, level=2), everything=False)
    assert "matern/short" not in whole and " cases passed" in whole
    assert "matern/short" in as_table(judge(golden, folder, precision, level=2), everything=True)


def test_a_trajectory_says_where_it_leaves_the_path(golden, answered, tmp_path):
    precision, folder = answered
    case = case_of(golden, "training/twenty_iterations")
    target = tmp_path / case.name
    target.mkdir(parents=True)
    for name in case.outputs:
        value = read_plain(folder / case.name / f"{name}.npy").copy()
        if name in ("loss", "term_ssim"):
            value[4:] += np.linspace(0.001, 0.1, value[4:].size)
        (target / f"{name}.npy").write_bytes(npy_bytes(value))
    report = judge(golden, tmp_path, precision, level=4, only=case.name)
    where = report.cases[0].first_wrong
    assert (
        where == "first wrong at iteration 5: term_ssim, loss; look at the images and terms; "
        "the detail weight leaves 0 at iteration 5"
    )
    assert report.diagnosis[1] == f"  training/twenty_iterations: {where}"
    (loss,) = [o for o in report.cases[0].outputs if o.name == "loss"]
    assert loss.index == (4,)
    assert where in as_table(report)


COMMANDS = {  # words of a command line on Windows, and on the other systems
    r"C:\ports\x.exe {requests} {outputs}": ([r"C:\ports\x.exe", "{requests}", "{outputs}"], "C:portsx.exe"),
    "\"C:\\my ports\\x.exe\" -n 'a b' {requests}": (
        [r"C:\my ports\x.exe", "-n", "a b", "{requests}"],
        r"C:\my ports\x.exe",
    ),
    r"./my\ port {requests}": (["./my\\", "port", "{requests}"], "./my port"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_the_words_of_a_command_are_those_of_the_system(command):
    windows, first = COMMANDS[command]
    assert words_of(command, backslash_escapes=False) == windows
    assert words_of(command, backslash_escapes=True)[0] == first
    assert words_of(command, backslash_escapes=True) == shlex.split(command)
