"""MAT-files whose arrays have elements that end the process inside SciPy are refused before it sees them."""

import io
import struct

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

from endotsr.errors import InputError
from endotsr.untrusted.matlab import read_mat

KIND_OF_NUMBERS, CLASS, LENGTHS = 184, 144, 160  # places in a file with one real array of the name `depth`


def stored(**variables) -> bytes:
    out = io.BytesIO()
    savemat(out, variables)
    return out.getvalue()


def words(data: bytes, place: int, *values: int) -> bytes:
    return data[:place] + struct.pack(f"<{len(values)}I", *values) + data[place + 4 * len(values) :]


PLANE = stored(depth=np.arange(1, 64, dtype=np.float32).reshape(7, 9))
CAMERA = stored(camera={"K": np.eye(3), "name": "left"}, parts=np.array([1.0, "two"], object))
CHANGED = {
    "an unknown kind of numbers": words(PLANE, KIND_OF_NUMBERS, 8),
    "an array in the place of numbers": words(PLANE, KIND_OF_NUMBERS, 14),
    "the imaginary part is missing": words(PLANE, CLASS, 0x806),
    "a sparse array without its columns": words(PLANE, CLASS, 5),
    "a struct without fields": words(PLANE, CLASS, 2),
    "a cell of numbers": words(PLANE, CLASS, 1),
    "numbers longer than the file": words(PLANE, KIND_OF_NUMBERS + 4, 4000),
    "numbers longer than their array": words(PLANE + PLANE[128:], KIND_OF_NUMBERS + 4, 300),
    "an array longer than the file": words(PLANE, 132, 4000),
    "a class of its own": words(PLANE, CLASS, 99),
    "one length": words(PLANE, LENGTHS - 4, 4),
    "cut off": PLANE[:-40],
    "complex numbers": stored(depth=np.ones((7, 9)) * 1j),
    "sparse": stored(depth=csc_array(np.eye(9))),
}


@pytest.mark.parametrize("kind", CHANGED)
def test_an_array_with_other_elements_than_its_class_has_is_refused(kind, tmp_path):
    (tmp_path / "a.mat").write_bytes(CHANGED[kind])
    with pytest.raises(InputError, match=r"a\.mat: damaged MAT-file: "):
        read_mat(tmp_path / "a.mat")


def test_the_elements_of_good_files_are_those_of_their_classes(tmp_path):
    (tmp_path / "a.mat").write_bytes(PLANE)
    np.testing.assert_array_equal(read_mat(tmp_path / "a.mat")["depth"], np.arange(1, 64).reshape(7, 9))
    (tmp_path / "a.mat").write_bytes(CAMERA)
    found = read_mat(tmp_path / "a.mat")
    assert found["camera"]["name"] == "left" and found["parts"] == [1, "two"]
