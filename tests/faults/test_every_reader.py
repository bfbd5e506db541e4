"""Every fault of a list in every file that a command reads: exit code 2 and one line, never a traceback or a wait."""

import json
import os
import shutil

import numpy as np
import pytest
from tiny import SETTINGS, assert_refused

from endotsr.results.evaluation.lpips import CHANNELS, KERNELS
from endotsr.untrusted.arrays import LONGEST_HEADER
from special_files import DAMAGE, NO_FILES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes"),
]


LARGE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999, 17), }"
FAULTS = {
    **NO_FILES,
    **DAMAGE,
    "long header": lambda p: p.write_bytes(b"\x93NUMPY\x02\x00\xff\xff\xff\x7f" + b"(" * LONGEST_HEADER),
    "large array": lambda p: p.write_bytes(b"\x93NUMPY\x01\x00\x76\x00" + LARGE.ljust(118)),
}  # fmt: skip

TRAIN = ["train", "{sequence}", "--out", "{out}", *SETTINGS]
READERS = {
    "images/000003.png": TRAIN,
    "poses_bounds.npy": TRAIN,
    "settings.toml": [*TRAIN, "--config", "{sequence}/settings.toml"],
    "SPEC.toml": ["sweep", "{sequence}/SPEC.toml", "--out", "{out}"],
    "weights.npz": [*TRAIN, "--lpips", "{sequence}/weights.npz"],
    "run/config.toml": ["render", "{run}", "--out", "{out}"],
    "run/run.json": ["evaluate", "{run}"],
    "run/sequence.json": ["render", "{run}", "--out", "{out}"],
    "run/checkpoint.npz": ["train", "--calibrate-only", "--out", "{run}"],
}


@pytest.fixture
def place(folder, run):
    """A folder with a sequence, settings, LPIPS weights and a run that has one checkpoint."""
    (folder / "settings.toml").write_text('preset = "paper"\n')
    (folder / "SPEC.toml").write_text('sequences = ["simulated"]\nconfigurations.base.model.appearance = false\n')
    weights = {"shift": np.zeros(3, np.float32), "scale": np.ones(3, np.float32)}
    for k, (before, after, size) in enumerate(zip(CHANNELS[:-1], CHANNELS[1:], KERNELS), start=1):
        weights[f"conv{k}_weight"] = np.zeros((after, before, size, size), np.float32)
        weights |= {f"conv{k}_bias": np.zeros(after, np.float32), f"lin{k}_weight": np.zeros(after, np.float32)}
    np.savez(folder / "weights.npz", **weights)
    (run / "checkpoint.previous.npz").unlink()
    shutil.move(run, folder / "run")
    return folder


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", READERS)
def test_every_fault_of_every_file_is_one_line(name, fault, place, tmp_path, capfd):
    if (name, fault) == ("settings.toml", "empty"):
        pytest.skip("an empty settings file asks for the preset")
    FAULTS[fault](place / name)
    out = tmp_path / "out"
    words = [word.format(sequence=place, run=place / "run", out=out) for word in READERS[name]]
    assert_refused(capfd, words, name.removeprefix("run/").split("/")[-1] if fault != "missing" else "")
    assert not out.exists()


def edited(change):
    """The record with one entry changed by a path of keys."""

    def apply(path):
        record = json.loads(path.read_text())
        *way, last = change[:-1]
        place = record
        for key in way:
            place = place[key]
        place[last] = change[-1]
        path.write_text(json.dumps(record))

    return apply


SEQUENCE = {
    "names are paths": ("names", 1, "../EVIL"),
    "absolute name": ("names", 1, "/tmp/EVIL"),
    "device name": ("names", 1, "NUL"),
    "control character": ("names", 1, "a\x1b[2Jb"),
    "number as name": ("names", 1, 7),
    "name twice": ("names", 1, "000000"),
    "NaN time": ("times", 1, float("nan")),
    "time beyond any number": ("times", 1, 10**400),
    "time outside": ("times", 1, -0.5),
    "fewer times": ("times", [0.0]),
    "no times": ("times", []),
    "names are null": ("names", None),
    "index out of range": ("train_index", 0, 9),
    "negative index": ("test_index", 0, -1),
    "index twice": ("train_index", 0, 2),
    "training and held out": ("test_index", 0, 0),
    "fractional index": ("test_index", 0, 1.5),
    "no cameras": ("cameras", []),
    "a camera too many": ("static_camera", False),
    "cameras as text": ("cameras", "none"),
    "negative width": ("cameras", 0, "width", -48),
    "width of no picture": ("cameras", 0, "width", 10**9),
    "focal length 0": ("cameras", 0, "fx", 0.0),
    "infinite principal point": ("cameras", 0, "cx", float("inf")),
    "flat rotation": ("cameras", 0, "rotation", 0, [0.0, 0.0, 0.0]),
    "short rotation": ("cameras", 0, "rotation", [[1.0, 0.0, 0.0]]),
    "unit as number": ("unit", 3),
    "static camera as text": ("static_camera", "yes"),
    "negative depth": ("largest_depth", -1.0),
}


@pytest.mark.parametrize("fault", SEQUENCE)
def test_a_wrong_entry_of_sequence_json_is_one_line(fault, run, tmp_path, capfd):
    edited(SEQUENCE[fault])(run / "sequence.json")
    words = ["render", str(run), "--out", str(tmp_path / "out" / "pictures"), "--frames", "all"]
    assert_refused(capfd, words, "sequence.json: ")
    assert not (tmp_path / "out").exists() and not list(tmp_path.rglob("*EVIL*"))


RUN = {
    "source as number": ("input", "source", 3),
    "source with a zero byte": ("input", "source", "a\0b"),
    "negative frames": ("input", "frames", -9),
    "width as text": ("input", "width", "48"),
    "tissue fraction": ("input", "tissue_fraction", 7.0),
    "notes as text": ("input", "notes", "none"),
    "hashes as list": ("input", "arrays_sha256", ["a"]),
    "negative seconds": ("seconds", -1.0),
    "memory as text": ("machine", "memory_bytes", "much"),
    "machine as list": ("machine", []),
    "resumed as number": ("resumed", 3),
    "weight": ("lambda_lap", -1),
    "version as number": ("versions", "numpy", 2),
}


@pytest.mark.parametrize("fault", RUN)
def test_a_wrong_entry_of_run_json_is_one_line(fault, run, capfd):
    edited(RUN[fault])(run / "run.json")
    assert_refused(capfd, ["evaluate", str(run)], "run.json: ")


@pytest.mark.parametrize("key", ["processor", "cores", "system"])
def test_a_record_that_lacks_what_the_report_needs_is_refused_before_the_report(key, run, capfd):
    record = json.loads((run / "run.json").read_text())
    del record["machine"][key]
    (run / "run.json").write_text(json.dumps(record))
    assert_refused(capfd, ["evaluate", str(run)], f"machine.{key} is missing")


@pytest.mark.parametrize("file", ["log.jsonl", "run.lock", "renders", "test"])
def test_a_link_in_a_run_folder_changes_no_file_elsewhere(file, run, tmp_path, capfd):
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "letter.txt").write_text("mine\n")
    (run / file).unlink(missing_ok=True)
    trained = file in ("log.jsonl", "run.lock")
    (run / file).symlink_to(victim / "letter.txt" if trained else victim)
    words = ["train", "--out", str(run), "--resume"] if trained else ["evaluate", str(run)]
    assert_refused(capfd, words, file, "is a link")
    assert (victim / "letter.txt").read_text() == "mine\n" and len(list(victim.iterdir())) == 1


LINES = ["{}", '{"iteration": "3"}', '{"iteration": NaN}', '{"iteration": 1e999}', "[" * 10_000]


@pytest.mark.parametrize("line", LINES, ids=range(len(LINES)))
def test_a_broken_line_of_the_log_is_cut_off(line, run, capfd):
    from endotsr.cli.main import main

    (run / "log.jsonl").write_text(line + "\n")
    assert main(["train", "--out", str(run), "--resume", "--no-evaluate"]) == 0


def test_a_record_cannot_put_a_script_into_the_report(run):
    from endotsr.cli.main import main

    record = json.loads((run / "run.json").read_text())
    script = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    record["input"]["notes"] = [script]
    record["machine"]["processor"] = record["versions"]["numpy"] = record["command"][0] = script
    (run / "run.json").write_text(json.dumps(record))
    assert main(["evaluate", str(run)]) == 0
    page = (run / "report.html").read_text()
    assert "<script>alert" not in page and "<img src=x" not in page and "&lt;script&gt;alert" in page
