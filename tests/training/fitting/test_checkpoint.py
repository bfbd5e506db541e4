"""Checkpoints: bitwise round trip, strict reading, nothing lost when the disk is full; hard case G5."""

import io
import json
import os
import zipfile

import numpy as np
import pytest

from endotsr.config import DensityConfig
from endotsr.errors import InputError
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.training.fitting.adam import adam_state, adam_update, regather
from endotsr.training.fitting.checkpoint import digest, load_checkpoint, restore_rng, save_checkpoint
from endotsr.training.scene.density_control import densify, empty_statistics, gather_statistics
from endotsr.training.scene.gaussians import Gaussians, arrays


def make(count=4, dtype=np.float32, fdm=True):
    rng = np.random.default_rng(count)

    def normal(*shape):
        return rng.normal(size=shape).astype(dtype)

    curves = {n: normal(10, 2, count) for n in ("fdm_weight", "fdm_centre", "fdm_width")} if fdm else {}
    gaussians = Gaussians(
        normal(3, count), normal(4, count), normal(3, count), normal(count), normal(4, 3, count), **curves
    )
    return gaussians, adam_state(arrays(gaussians))


def step(gaussians, adam, statistics, rng, iteration):
    """A training iteration in miniature: random gradients, statistics, a densification now and then."""
    named = arrays(gaussians)
    dtype = gaussians.position.dtype
    gradients = {n: rng.normal(size=a.shape).astype(dtype) for n, a in named.items()}
    gather_statistics(statistics, gradients["position"][:2], np.ones(gaussians.count, bool), 4, 4)
    adam_update(adam, named, gradients, dict.fromkeys(named, 1e-2), 0.9, 0.999, 1e-15)
    if iteration % 3 == 0:
        result = densify(gaussians, statistics, DensityConfig(gradient_threshold=2.5), rng, 10.0)
        regather(adam, named, result.plan.source, result.plan.survivors)
        return result.gaussians, adam, result.statistics
    return gaussians, adam, statistics


def assert_equal(one, two):
    assert arrays(one[0]).keys() == arrays(two[0]).keys()
    for name, array in arrays(one[0]).items():
        for a, b in (
            (array, getattr(two[0], name)),
            (one[1].first[name], two[1].first[name]),
            (one[1].second[name], two[1].second[name]),
        ):
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
    assert one[1].step == two[1].step
    np.testing.assert_array_equal(one[2].gradient_sum, two[2].gradient_sum)
    np.testing.assert_array_equal(one[2].visits, two[2].visits)


def save(path, gaussians, adam, statistics=None, rng=None, iteration=7):
    rng = rng or np.random.default_rng(0)
    save_checkpoint(
        path, gaussians, adam, iteration, rng.bit_generator.state,
        statistics or empty_statistics(gaussians.count), {"note": "ü", "rate": 0.1 + 0.2},
    )  # fmt: skip


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("fdm", [True, False])
@pytest.mark.parametrize("count", [0, 4])
def test_round_trip_is_bitwise_and_none_stays_none(tmp_path, dtype, fdm, count):
    gaussians, adam = make(count, dtype, fdm)
    if count:
        gaussians.position[0, :3] = [np.finfo(dtype).max, -0.0, np.finfo(dtype).tiny / 4]
    adam.step["position"] = 12
    save(tmp_path / "a.npz", gaussians, adam)
    found = load_checkpoint(tmp_path / "a.npz")
    assert_equal((gaussians, adam, empty_statistics(count)), (found.gaussians, found.adam, found.statistics))
    assert gaussians.position.tobytes() == found.gaussians.position.tobytes()
    assert found.gaussians.appearance_coefficients is None
    assert (found.gaussians.fdm_weight is None) == (not fdm)
    assert (found.iteration, found.header) == (7, {"note": "ü", "rate": 0.1 + 0.2})
    assert os.listdir(tmp_path) == ["a.npz"]


def test_hard_G5_save_load_continue_equals_uninterrupted(tmp_path):
    rng = np.random.default_rng(42)
    state = (*make(6), empty_statistics(6))
    for iteration in range(1, 5):
        state = step(*state, rng, iteration)
    save(tmp_path / "a.npz", *state, rng=rng, iteration=4)
    for iteration in range(5, 10):
        state = step(*state, rng, iteration)
    found = load_checkpoint(tmp_path / "a.npz")
    resumed, generator = (found.gaussians, found.adam, found.statistics), restore_rng(found.rng_state)
    for iteration in range(found.iteration + 1, 10):
        resumed = step(*resumed, generator, iteration)
    assert state[0].count > 6
    assert_equal(state, resumed)
    assert rng.random() == generator.random()


@pytest.mark.parametrize("value", [41.0, 89.0, 3e38, -1001.0, -3e38])
def test_a_log_scale_that_is_clipped_where_it_is_used_is_read_and_renders_as_the_clipped_one(value, tmp_path):
    """B2 clips at 40, so that a training may go on with any log-scale; its checkpoint has to be readable."""
    gaussians, adam = make()
    gaussians.log_scale[0, 1] = value
    save(tmp_path / "checkpoint.npz", gaussians, adam)
    read = load_checkpoint(tmp_path / "checkpoint.npz").gaussians
    assert read.log_scale[0, 1] == np.float32(value)
    clipped = read.log_scale.copy()
    clipped[0, 1] = np.copysign(40.0, value)
    shapes = [covariance_forward(read.quaternion, scale)[0].scale for scale in (read.log_scale, clipped)]
    np.testing.assert_array_equal(*shapes)


def rewrite(path, change):
    """The checkpoint with its entries changed by `change(dict)`; the header is a dictionary in it."""
    with np.load(path) as file:
        entries = {k: file[k] for k in file.files}
    entries["header"] = json.loads(entries["header"].tobytes())
    change(entries)
    if "header" in entries:
        for key, listed in entries["header"]["arrays"].items():
            if key in entries and entries[key].dtype != object:
                listed[2:] = [digest(entries[key])]
        entries["header"] = np.frombuffer(json.dumps(entries["header"]).encode(), np.uint8)
    np.savez(path, **entries)


def forget(entries, key):
    """Remove an entry and its line in the header."""
    del entries[key], entries["header"]["arrays"][key]


BROKEN = {
    "gaussians.harmonics: missing": lambda e: e.pop("gaussians.harmonics"),
    "gaussians.quaternion: missing": lambda e: forget(e, "gaussians.quaternion"),
    "statistics.visits: missing": lambda e: forget(e, "statistics.visits"),
    "header: missing": lambda e: e.pop("header"),
    "version: 99": lambda e: e["header"].update(version=99),
    "not a checkpoint of this program": lambda e: e["header"].update(format="other"),
    "header.iteration: int": lambda e: e["header"].update(iteration="7"),
    "first.opacity_logit: .* header says": lambda e: e.update({"first.opacity_logit": np.zeros(9, np.float32)}),
    "extra: not listed": lambda e: e.update(extra=np.zeros(1)),
    "gaussians.colour: not known": lambda e: (
        e.update({"gaussians.colour": np.zeros(1)}),
        e["header"]["arrays"].update({"gaussians.colour": ["<f8", [1]]}),
    ),
    "gaussians.log_scale: cannot be read: it holds Python objects": lambda e: e.update(
        {"gaussians.log_scale": np.array([None, {}], dtype=object)}
    ),
    "name different arrays": lambda e: e["header"]["steps"].pop("position"),
    "opacity_logit: .* for 4 Gaussians": lambda e: (
        e.update({"gaussians.opacity_logit": np.zeros(3, np.float32)}),
        e["header"]["arrays"].update({"gaussians.opacity_logit": ["<f4", [3]]}),
    ),
}  # fmt: skip


@pytest.mark.parametrize("message", BROKEN)
def test_broken_checkpoints_are_refused_by_file_and_key(tmp_path, message):
    path = tmp_path / "broken.npz"
    save(path, *make())
    rewrite(path, BROKEN[message])
    with pytest.raises(InputError, match=message) as caught:
        load_checkpoint(path)
    assert "broken.npz" in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.9, 0.999])
def test_truncated_file_is_refused(tmp_path, share):
    path = tmp_path / "a.npz"
    save(path, *make())
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"a\.npz"):
        load_checkpoint(path)


def test_damaged_bytes_are_refused_by_key(tmp_path):
    path = tmp_path / "a.npz"
    save(path, *make(count=40))
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        start = archive.getinfo("gaussians.fdm_weight.npy").header_offset
    data[start + 1000] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.npz: gaussians\.fdm_weight: cannot be read"):
        load_checkpoint(path)


def test_missing_file_and_plain_array_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.npz: cannot be read"):
        load_checkpoint(tmp_path / "none.npz")
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    (tmp_path / "plain.npz").write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match="not a checkpoint"):
        load_checkpoint(tmp_path / "plain.npz")


def test_full_disk_leaves_the_previous_checkpoint(tmp_path):
    """A file size limit stands for the full disk: writing fails in the middle of the arrays."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "a.npz"
    save(path, *make())
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(OSError, match="large"):
            save(path, *make(count=400), iteration=8)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.npz"]
    assert load_checkpoint(path).iteration == 7


@pytest.mark.parametrize("where", ["fsync", "replace"])
def test_failure_at_the_last_moment_leaves_the_previous_checkpoint(tmp_path, monkeypatch, where):
    path = tmp_path / "a.npz"
    save(path, *make())

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, where, full)
    with pytest.raises(OSError, match="No space left"):
        save(path, *make(), iteration=8)
    assert os.listdir(tmp_path) == ["a.npz"]
    assert load_checkpoint(path).iteration == 7
