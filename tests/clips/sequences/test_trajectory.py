"""Trajectories whose head line states the order of the quaternion."""

import numpy as np
import pytest

from endotsr.clips.sequences.trajectory import read_trajectory

TURN = {"w": 0.5, "x": 0.5, "y": -0.5, "z": 0.5}


@pytest.mark.parametrize(("head", "order"), [
    ("# stamp tx ty tz qx qy qz qw", "xyzw"), ("# a comment", "xyzw"),
    ("#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z", "wxyz"),
    ("#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []", "wxyz"),
])  # fmt: skip
def test_a_head_line_states_the_order_of_the_quaternion(head, order, tmp_path):
    (tmp_path / "a.txt").write_text(f"{head}\n0 1 2 3 " + " ".join(str(TURN[axis]) for axis in order))
    (tmp_path / "b.txt").write_text("0 1 2 3 0.5 -0.5 0.5 0.5")
    found, expected = (read_trajectory(tmp_path / name, "mm").poses[0] for name in ("a.txt", "b.txt"))
    np.testing.assert_array_equal(found.rotation, expected.rotation)
