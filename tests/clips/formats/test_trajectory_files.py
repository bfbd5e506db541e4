"""Trajectory files that are no text, or hold rows that are no poses: refused by file and row, with what is allowed."""

import numpy as np
import pytest

from endotsr.clips.formats.trajectory_lines import stored_poses
from endotsr.errors import InputError


def lost(poses):
    poses[5:7] = np.nan
    return poses


REFUSED = {
    "poses that were lost": (lambda p: np.save(p / "t.npy", lost(np.tile(np.eye(4), (9, 1, 1)))), "t.npy",
                             "t.npy: row 5: holds a number that is not finite; such rows: 2 of 9; use finite"),
    "frames last": (lambda p: np.save(p / "t.npy", np.zeros((4, 4, 9))), "t.npy",
                    r"array of shape \(4, 4, 9\); use"),
    "objects": (lambda p: np.save(p / "t.npy", np.array([np.eye(4), None], object), allow_pickle=True), "t.npy",
                "it holds Python objects; use numbers, as numpy.stack makes"),
    "an archive of arrays": (lambda p: np.savez(p / "t.npz", poses=np.eye(4)), "t.npz",
                             "t.npz: cannot be read: not UTF-8 text.*; use text in UTF-8, or one array in a file"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_is_no_trajectory_is_refused(case, tmp_path):
    make, name, said = REFUSED[case]
    make(tmp_path)
    with pytest.raises(InputError, match=said):
        stored_poses(tmp_path / name)
