"""Headers of .npy files: what NumPy writes is read, everything else is refused quickly."""

import io
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from numpy.lib import format as npy

from endotsr.errors import InputError
from endotsr.untrusted.arrays import LONGEST_HEADER, read_npy, read_npz

ARRAYS = {
    "number": np.array(2.5),
    "vector": np.arange(5, dtype=np.int16),
    "Fortran order": np.asfortranarray(np.arange(12.0).reshape(3, 4)),
    "big-endian": np.arange(6, dtype=">f4").reshape(2, 3),
    "truth values": np.array([[True, False]]),
    "empty": np.zeros((0, 3), np.float32),
}


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.filterwarnings("ignore:Stored array in format")
def test_what_numpy_writes_is_read(name, version, tmp_path):
    with (tmp_path / "a.npy").open("wb") as file:
        npy.write_array(file, ARRAYS[name], version)
    found = read_npy(tmp_path / "a.npy", 1000)
    assert found.dtype == ARRAYS[name].dtype
    np.testing.assert_array_equal(found, ARRAYS[name], strict=True)


def stored(header: str, body: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode("latin-1") + body


def test_lengths_that_python_2_wrote_are_read(tmp_path):
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2L, 1L), }"
    (tmp_path / "a.npy").write_bytes(stored(header, bytes(16)))
    assert read_npy(tmp_path / "a.npy", 1000).shape == (2, 1)


REFUSED = {
    "no dictionary": "[1, 2]",
    "a key is missing": "{'descr': '<f8', 'shape': (2,)}",
    "a shape that is a list": "{'descr': '<f8', 'fortran_order': False, 'shape': [2]}",
    "a length that is true": "{'descr': '<f8', 'fortran_order': False, 'shape': (True,)}",
    "an order that is a number": "{'descr': '<f8', 'fortran_order': 0, 'shape': (2,)}",
    "an unknown type": "{'descr': 'frog\x1b[2J', 'fortran_order': False, 'shape': (2,)}",
    "fields": "{'descr': [('a', '<f4'), ('b', '<f4')], 'fortran_order': False, 'shape': (2,)}",
    "a call": "__import__('os').getcwd()",
    "deep": "(" * LONGEST_HEADER,
    "signs": "-" * LONGEST_HEADER,
    "words": "{'des'x: '<f8', }" + " " * 3000 + "\0" + " " * 900,
}


@pytest.mark.parametrize("reason", REFUSED)
def test_anything_else_is_refused_in_one_visible_line(reason, tmp_path, monkeypatch):
    """And it is not split into tokens, as by NumPy's own reader, which takes seconds for words."""
    (tmp_path / "a.npy").write_bytes(stored(REFUSED[reason], bytes(16)))
    monkeypatch.setattr("tokenize.generate_tokens", lambda *_: pytest.fail("the header is split into tokens"))
    with pytest.raises(InputError, match=r"a.npy: not a plain NumPy array file") as refused:
        read_npy(tmp_path / "a.npy", 10_000)
    assert "\x1b" not in str(refused.value) and "\n" not in str(refused.value)


def test_named_arrays_of_an_archive_are_read_and_others_left_alone(tmp_path):
    out = io.BytesIO()
    np.savez_compressed(out, a=np.arange(3), b=np.array([None]))
    (tmp_path / "a.npz").write_bytes(out.getvalue())
    found = read_npz(tmp_path / "a.npz", ("a", "c"), 1000)
    assert list(found) == ["a"] and found["a"].tolist() == [0, 1, 2]
    with pytest.raises(InputError, match=r"a.npz: b: it holds Python objects"):
        read_npz(tmp_path / "a.npz", ("a", "b"), 1000)


@pytest.mark.parametrize("sides", [f"(0, {1 << 70})", f"(0, {1 << 62}, {1 << 62})", f"(0, {1 << 62})"])
def test_an_empty_array_of_impossible_sides_is_refused(sides, tmp_path):
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {sides}}}"
    (tmp_path / "a.npy").write_bytes(stored(header))
    with pytest.raises(InputError, match=r"a\.npy: not a plain NumPy array file: "):
        read_npy(tmp_path / "a.npy", 1000)


def test_an_entry_that_states_more_bytes_than_it_has_is_refused_before_its_array_is_allocated(tmp_path):
    size = 1 << 28
    header = f"{{'descr': '|u1', 'fortran_order': False, 'shape': ({size},)}}"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", stored(header))
    content = bytearray((tmp_path / "a.npz").read_bytes())
    place = content.find(b"PK\x01\x02") + 24  # the size in the central directory
    content[place : place + 4] = struct.pack("<I", len(stored(header)) + size)
    (tmp_path / "a.npz").write_bytes(content)
    tracemalloc.start()
    with pytest.raises(InputError, match="an entry states"):
        read_npz(tmp_path / "a.npz", ["a"], 1 << 30)
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 1 << 20


def test_a_name_with_and_without_its_ending_is_one_name(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for name in ("a", "a.npy"):
            archive.writestr(name, b"")
    with pytest.raises(InputError, match="an entry is listed twice"):
        read_npz(tmp_path / "a.npz", ["a"], 1 << 20)
