"""The run folder as files: complete or absent, replaced whole, logs cut at the checkpoint."""

import errno
import json
import os

import msgspec
import numpy as np
import pytest
from tiny import assert_refused

from endotsr.cli.main import main
from endotsr.clips.sequences.record import SequenceRecord, read_sequence_record, record_of, recorded
from endotsr.clips.simulator.sections import CameraMotion
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.training.runs import files, machine
from endotsr.training.runs import folder as runs
from endotsr.training.runs.log import RunLog
from endotsr.untrusted.writing import replace_file

ONE_FRAME = SequenceRecord(
    unit="mm", largest_depth=9.0, static_camera=True, names=["a"], times=[0.0], train_index=[0], test_index=[],
    cameras=recorded([Camera(np.eye(3), np.zeros(3), 50.0, 50.0, 24.0, 16.0, 48, 32)]),
)  # fmt: skip


def created(path):
    return runs.create_run(path, PAPER, {"seed": 0}, ONE_FRAME)


def test_new_folder_reads_back(tmp_path):
    folder = created(tmp_path / "a" / "run")
    again = runs.open_run(tmp_path / "a" / "run")
    assert again == folder and again.config() == PAPER
    assert again.record() == {"seed": 0} and again.sequence_record() == ONE_FRAME
    assert folder.log.read_bytes() == b""
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["run"]


@pytest.mark.parametrize("kind", ["run", "folder", "file", "dangling link"])
def test_anything_that_exists_is_refused(kind, tmp_path):
    path = tmp_path / "run"
    if kind == "run":
        created(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "file":
        path.write_text("mine")
    else:
        path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="--resume" if kind == "run" else "exists already"):
        created(path)


def test_failure_while_filling_leaves_nothing(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(runs, "write_json", full)
    with pytest.raises(InputError, match="run: the disk is full"):
        created(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_replacing_a_file_keeps_the_old_one_on_failure(tmp_path):
    file = tmp_path / "metrics.json"
    files.write_json(file, {"psnr": 1.0})

    def broken(temporary):
        temporary.write_text("{")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError):
        replace_file(file, broken)
    assert json.loads(file.read_text()) == {"psnr": 1.0}
    assert list(tmp_path.iterdir()) == [file]


def test_json_has_no_nan(tmp_path):
    files.write_json(tmp_path / "a.json", {"a": float("nan"), "b": [np.float32(np.inf), np.arange(2)], "c": tmp_path})
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": None, "b": [None, [0, 1]], "c": str(tmp_path)}


def log_of(path, iterations, tail=b""):
    lines = b"".join(json.dumps({"iteration": i, "seconds": 0.5}).encode() + b"\n" for i in iterations)
    path.write_bytes(lines + tail)


@pytest.mark.parametrize("tail", [b"", b'{"iteration": 6, "lo', b'{"iteration": 6}', b"\x00\x00\n", b"\n"])
def test_resumed_log_is_cut_at_the_checkpoint(tail, tmp_path):
    path = tmp_path / "log.jsonl"
    log_of(path, range(1, 6), tail)
    log = RunLog(path, 3)
    assert log.seconds == 1.5
    log.append({"iteration": 4, "loss": float("nan")})
    log.close()
    entries = [json.loads(line) for line in path.read_text().splitlines()]
    assert [entry["iteration"] for entry in entries] == [1, 2, 3, 4] and entries[-1]["loss"] is None


def test_log_keeps_whole_lines_when_the_disk_is_full(tmp_path):
    path = tmp_path / "log.jsonl"
    log = RunLog(path, 0)
    log.append({"iteration": 1})
    whole = path.read_bytes()

    class HalfWritten:
        def __init__(self, file):
            self.file = file

        def write(self, line):
            os.write(self.file.fileno(), line[:5])
            raise OSError(errno.ENOSPC, "No space left on device")

        def __getattr__(self, name):
            return getattr(self.file, name)

    log._file = HalfWritten(log._file)  # type: ignore[assignment]
    with pytest.raises(OSError):
        log.append({"iteration": 2})
    assert path.read_bytes() == whole


def test_replacing_folder_swaps_or_vanishes(tmp_path):
    target = tmp_path / "renders"
    with runs.replacing_folder(target) as folder:
        (folder / "a").touch()
    with pytest.raises(ValueError), runs.replacing_folder(target) as folder:
        raise ValueError
    assert [p.name for p in target.iterdir()] == ["a"]
    with runs.replacing_folder(target) as folder:
        (folder / "b").touch()
    assert [p.name for p in target.iterdir()] == ["b"] and len(list(tmp_path.iterdir())) == 1


def test_leftovers_of_a_killed_process_are_removed(tmp_path):
    folder = created(tmp_path / "run")
    (folder.path / ".checkpoint.npz.17.part").touch()
    (folder.path / ".partial-9-renders").mkdir()
    folder.remove_leftovers()
    assert not any(p.name.startswith(".") for p in folder.path.iterdir())


def test_machine_and_versions_say_something():
    assert machine.machine()["cores"] >= 1 and machine.machine()["processor"]
    assert {"endotsr", "python", "numpy", "numba"} <= set(machine.versions())
    peak = machine.peak_memory_bytes()
    assert peak is None or peak > 10_000_000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{}", "input.source is missing"),
        ('{"input": {}}', "input.source is missing"),
        ('{"input": 3}', "input"),
        ('{"input": {"source": "simulated"}}', "input.arrays_sha256 is missing"),
        ('{"input": {"source": "x", "arrays_sha256": {}, "simulator": {"width": "x"}}}', "input.simulator.width = 'x'"),
        ("[]", "holds list; use an object"),
    ],
)
def test_run_json_without_its_keys_is_one_line(text, said, run_copy, capsys):
    run = run_copy
    (run / "run.json").write_text(text)
    for words in (
        ["evaluate", str(run)],
        ["train", "--calibrate-only", "--out", str(run)],
        ["train", "--out", str(run), "--resume"],
    ):
        assert_refused(capsys, words, f"{run / 'run.json'}: ", said)


@pytest.mark.parametrize("key", ["names", "times", "train_index", "test_index", "cameras", "static_camera", "unit"])
def test_sequence_json_without_its_keys_is_one_line(key, run_copy, tmp_path, capsys):
    run = run_copy
    record = json.loads((run / "sequence.json").read_text())
    del record[key]
    (run / "sequence.json").write_text(json.dumps(record))
    words = ["render", str(run), "--out", str(tmp_path / "pictures")]
    assert_refused(capsys, words, f"{run / 'sequence.json'}: {key} is missing")
    assert not (tmp_path / "pictures").exists()
    if key in ("times", "train_index"):
        assert_refused(capsys, ["evaluate", str(run)], f"{run / 'sequence.json'}: {key} is missing")


def test_a_sequence_json_with_the_near_plane_of_earlier_versions_is_read(run_copy, tmp_path):
    record = json.loads((run_copy / "sequence.json").read_text())
    assert "near" not in record
    (run_copy / "sequence.json").write_text(json.dumps(record | {"near": 0.2}))
    assert main(["render", str(run_copy), "--out", str(tmp_path / "pictures")]) == 0


def test_a_random_state_of_another_generator_is_one_line(run_copy, capsys):
    run = run_copy
    with np.load(run / "checkpoint.npz") as file:
        entries = {key: file[key] for key in file.files}
    header = json.loads(entries["header"].tobytes())
    header["rng_state"] = {"bit_generator": "MT19937"}
    entries["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(run / "checkpoint.npz", **entries)
    assert_refused(capsys, ["train", "--out", str(run), "--resume"], f"{run / 'checkpoint.npz'}: rng_state: ")


@pytest.mark.parametrize("moving", [False, True])
def test_cameras_are_remembered_to_the_last_bit(moving, tmp_path):
    settings = SimulatorSettings(width=32, height=24, frames=9, camera_motion=CameraMotion(on=moving))
    sequence = simulate(settings).sequence
    files.write_json(tmp_path / "sequence.json", msgspec.to_builtins(record_of(sequence)))
    record = read_sequence_record(tmp_path / "sequence.json")
    cameras = record.frame_cameras
    assert record == record_of(sequence)
    assert len(cameras) == 9 and len(record.cameras) == (9 if moving else 1)
    for camera, remembered in zip(sequence.cameras, cameras, strict=True):
        for a, b in zip(camera, remembered, strict=True):
            assert np.array_equal(a, b)
    assert record.times == sequence.times.tolist() and record.test_index == sequence.test_index.tolist()
