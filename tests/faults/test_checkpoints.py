"""Two checkpoints are kept, checked and bound to their sequence; files of version 1 are still read."""

import json
import os
import shutil

import numpy as np
import pytest
from tiny import assert_refused, assert_same_run, run_line, scene, train_words

from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.training.fitting import checkpoint as checkpoints
from endotsr.training.fitting.checkpoint import DamagedCheckpoint, digest, load_checkpoint, load_latest, previous_of

RESUME = ["--resume", "--no-evaluate"]


def rewrite(path, change, *, version=2):
    """The checkpoint changed by `change(entries, header)`, with the checksums that then fit."""
    with np.load(path) as file:
        entries = {name: file[name] for name in file.files}
    header = json.loads(entries.pop("header").tobytes())
    change(entries, header)
    header["version"] = version
    header["arrays"] = {name: [a.dtype.str, list(a.shape), digest(a)][: version + 1] for name, a in entries.items()}
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(path, header=text, **entries)


def damage(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)


def test_the_last_two_checkpoints_are_kept(run):
    latest, previous = load_checkpoint(run / "checkpoint.npz"), load_checkpoint(run / "checkpoint.previous.npz")
    assert (latest.iteration, previous.iteration) == (30, 28)
    assert previous_of(run / "checkpoint.npz") == run / "checkpoint.previous.npz"
    assert not [name for name in os.listdir(run) if name.endswith(".part")]


@pytest.mark.parametrize("lost", ["damaged", "cut short", "empty", "removed"])
def test_the_one_before_takes_the_place_of_a_damaged_one(lost, trained, run, capsys):
    latest = run / "checkpoint.npz"
    if lost == "damaged":
        damage(latest)
    elif lost == "removed":
        latest.unlink()
    else:
        latest.write_bytes(latest.read_bytes()[: 0 if lost == "empty" else 5000])
    code, said = run_line(capsys, "train", "--out", str(run), *RESUME)
    assert code == 0 and ("checkpoint.previous.npz, iteration 28" in said) == (lost != "removed")
    assert ("checkpoint.npz: " in said) == (lost != "removed")
    assert_same_run(trained, run)
    assert (run / "checkpoint.damaged.npz").exists() == (lost != "removed")
    assert load_checkpoint(run / "checkpoint.previous.npz").iteration == 28  # never the damaged one


def test_a_render_says_that_it_uses_the_one_before(run, tmp_path, capsys):
    damage(run / "checkpoint.npz")
    code, said = run_line(capsys, "render", str(run), "--out", str(tmp_path / "pictures"))
    assert code == 0 and said.startswith("endotsr: warning: ") and "is used: checkpoint.previous.npz" in said
    assert (run / "checkpoint.npz").exists()  # a reader changes nothing


def test_two_damaged_checkpoints_are_one_line(run, capsys):
    for name in ("checkpoint.npz", "checkpoint.previous.npz"):
        damage(run / name)
    assert_refused(capsys, ["train", "--out", str(run), *RESUME], f"{run / 'checkpoint.npz'}: ")


@pytest.mark.parametrize("links", [True, False])
def test_a_kill_between_the_renames_leaves_a_whole_checkpoint(links, trained, run, monkeypatch):
    """With and without hard links, stopped before each of the renames of a save."""
    if not links:
        monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(OSError("no hard links")))
    from endotsr.config import load_config
    from endotsr.training.fitting.state import save_state, state_from_checkpoint

    config = load_config(run / "config.toml")
    state = state_from_checkpoint(load_checkpoint(run / "checkpoint.npz"), config)
    replace, stops = os.replace, 0
    for stop in range(3):
        calls = []

        def killed(*names, stop=stop, calls=calls):
            if len(calls) == stop:
                raise KeyboardInterrupt
            calls.append(names)
            replace(*names)

        monkeypatch.setattr(os, "replace", killed)
        try:
            save_state(run / "checkpoint.npz", state, config)
        except KeyboardInterrupt:
            stops += 1
        found, note = load_latest(run / "checkpoint.npz")
        assert found.iteration in (28, 30) and note == ""
    assert stops >= 2


def test_a_digest_that_does_not_fit_is_damage(run):
    path = run / "checkpoint.npz"
    rewrite(path, lambda entries, header: None)
    with np.load(path) as file:
        entries = {name: file[name] for name in file.files}
    entries["gaussians.position"] = entries["gaussians.position"] + 1
    np.savez(path, **entries)
    with pytest.raises(DamagedCheckpoint, match=r"gaussians\.position: its SHA-256 is not the one in the header"):
        load_checkpoint(path)


def test_a_checkpoint_of_another_sequence_is_refused(run, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(train_words(other, "--no-evaluate", source=scene(seed=5))) == 0
    shutil.copy(other / "checkpoint.npz", run)
    for words in (
        ["train", "--out", str(run), *RESUME],
        ["evaluate", str(run)],
        ["train", "--calibrate-only", "--out", str(run)],
    ):
        assert_refused(capsys, words, "checkpoint.npz: trained on another sequence")


def test_cameras_belong_to_the_sequence(run, capsys):
    record = json.loads((run / "run.json").read_text())
    record["input"]["arrays_sha256"]["cameras"] = "0" * 64
    (run / "run.json").write_text(json.dumps(record))
    rewrite(run / "checkpoint.npz", lambda entries, header: header["header"].pop("sequence"))
    assert_refused(capsys, ["evaluate", str(run)], "cameras differ from those the run")


def test_version_1_is_read_and_continued(trained, run):
    """As the first version wrote it: no digests, no fingerprint, no previous checkpoint."""
    (run / "checkpoint.npz").unlink()
    (run / "checkpoint.previous.npz").rename(run / "checkpoint.npz")
    rewrite(run / "checkpoint.npz", lambda entries, header: header["header"].pop("sequence"), version=1)
    assert load_checkpoint(run / "checkpoint.npz").iteration == 28
    assert main(["train", "--out", str(run), *RESUME]) == 0
    assert_same_run(trained, run)


@pytest.mark.parametrize("version", [0, 3, "2", None, True, [2]])
def test_a_version_that_is_not_known_is_refused_and_not_worked_around(version, run):
    rewrite(run / "checkpoint.npz", lambda entries, header: None)
    with np.load(run / "checkpoint.npz") as file:
        entries = {name: file[name] for name in file.files}
    header = json.loads(entries["header"].tobytes()) | {"version": version}
    entries["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(run / "checkpoint.npz", **entries)
    with pytest.raises(InputError, match=r"version: .*; this program reads 1, 2"):
        load_latest(run / "checkpoint.npz")


def put(name, index, value):
    def change(entries, header):
        entries[name] = entries[name].copy()
        entries[name][index] = value

    return change


def cast(name, dtype):
    return lambda entries, header: entries.update({name: entries[name].astype(dtype)})


VALUES = {
    "NaN position": (put("gaussians.position", (1, 2), np.nan), r"position\[1, 2\] is nan"),
    "infinite opacity": (put("gaussians.opacity_logit", 5, np.inf), r"opacity_logit\[5\] is inf"),
    "NaN harmonics": (put("gaussians.harmonics", (0, 1, 2), np.nan), r"harmonics\[0, 1, 2\] is nan"),
    "infinite log-scale": (put("gaussians.log_scale", (0, 0), np.inf), r"log_scale\[0, 0\] is inf"),
    "NaN moment": (put("first.position", (0, 0), np.nan), r"first position\[0, 0\] is nan"),
    "negative second moment": (put("second.position", (0, 0), -1.0), r"second position\[0, 0\] is -1"),
    "negative visits": (put("statistics.visits", 0, -1), r"visits\[0\] is -1"),
    "NaN statistics": (put("statistics.gradient_sum", 0, np.nan), "gradient_sum"),
    "visits in float": (cast("statistics.visits", np.float64), "int64 visits"),
    "other precision": (cast("gaussians.harmonics", np.float64), "the same in every array"),
    "half precision": (cast("gaussians.position", np.float16), "use float32 or float64"),
    "integer moments": (cast("second.log_scale", np.int32), "second log_scale"),
    "negative iteration": (lambda entries, header: header.update(iteration=-1), "iteration is no number of iterations"),
    "true iteration": (lambda entries, header: header.update(iteration=True), "int expected"),
    "negative step": (lambda entries, header: header["steps"].update(position=-3), "no number of iterations"),
    "no axis": (
        lambda entries, header: [entries.update({f"{g}.position": np.float32(1)}) for g in ("gaussians", "first")],
        "position: 0 axes",
    ),
    "one FDM array": (lambda entries, header: entries.pop("gaussians.fdm_width"), "fdm_width"),
    "moments of nothing": (
        lambda entries, header: entries.pop("gaussians.motion_coefficients"),
        "first: moments of .*motion_coefficients",
    ),
}


@pytest.mark.parametrize("fault", VALUES)
def test_numbers_that_no_training_has_are_refused_by_name(fault, run, capsys):
    change, said = VALUES[fault]
    (run / "checkpoint.previous.npz").unlink()
    rewrite(run / "checkpoint.npz", change)
    with pytest.raises(DamagedCheckpoint, match=said):
        load_checkpoint(run / "checkpoint.npz")
    assert_refused(capsys, ["train", "--out", str(run), *RESUME], "checkpoint.npz: ")


ENTRIES = [  # of the header
    *(("header", {"lambda_lap": weight}, "header.lambda_lap: ") for weight in (-1.0, "0.83", [1])),
    *(("rng_state", state, "") for state in (
        {},
        {"bit_generator": "PCG64", "state": 5},
        {"bit_generator": "PCG64", "state": {"state": -1, "inc": 1}, "has_uint32": 0, "uinteger": 0},
        {"bit_generator": "PCG64", "state": {"state": 1, "inc": 1 << 190}, "has_uint32": 0, "uinteger": 0},
    )),
]  # fmt: skip


@pytest.mark.parametrize(("key", "entry", "said"), ENTRIES, ids=range(len(ENTRIES)))
def test_a_laplacian_weight_or_a_random_state_that_is_none_is_refused(key, entry, said, run, capsys):
    before = (lambda header: header["header"]) if key == "header" else (lambda header: {})
    rewrite(run / "checkpoint.npz", lambda _, header: header.update({key: before(header) | entry}))
    assert_refused(capsys, ["train", "--out", str(run), *RESUME], f"checkpoint.npz: {said}")


def test_a_killed_save_leaves_files_that_the_next_resume_removes(trained, run):
    for name in (".checkpoint.npz.12ab34cd.part", ".checkpoint.previous.npz.12ab34cd.part"):
        (run / name).write_bytes(b"half")
    assert main(["train", "--out", str(run), *RESUME]) == 0
    assert not [p for p in run.iterdir() if p.name.startswith(".")]
    assert_same_run(trained, run)


def test_every_version_has_its_reader():
    assert set(checkpoints.READERS) == set(range(1, checkpoints.VERSION + 1))
