"""Trajectory files that are no text, or hold rows that are no poses: refused by file and row, with what is allowed."""

import numpy as np
import pytest

from endotsr.clips.formats.trajectory import read_trajectory
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
    "a name in a column that is used": (lambda p: (p / "t.csv").write_text("t,x,y,z,qx,qy,qz,qw\n0,a,0,0,0,0,0,1\n"),
                                        "t.csv", "line 2: use 8 finite numbers.*; 'a' is no number"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_is_no_trajectory_is_refused(case, tmp_path):
    make, name, said = REFUSED[case]
    make(tmp_path)
    with pytest.raises(InputError, match=said):
        stored_poses(tmp_path / name)


HEADS = {
    "stamp,tx [mm],ty [mm],tz [mm],qx,qy,qz,qw": "mm",
    "# stamp p_x(cm) p_y(cm) p_z(cm) q_x() q_y() q_z() q_w()": "cm",
    "Time;Position X_mm;Position Y_mm;Position Z_mm;Quat X;Quat Y;Quat Z;Quat W": "mm",
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []": "m",
    "stamp tx ty tz qx qy qz qw": "",
}


@pytest.mark.parametrize("head", HEADS)
def test_the_unit_of_a_head_line_is_not_read_as_metres(head, tmp_path):
    stated, separator = HEADS[head], ";" if ";" in head else "," if "," in head else " "
    turn = ["1", "0", "0", "0"] if "q_RS_w" in head else ["0", "0", "0", "1"]
    rows = [separator.join([str(k), str(k), "0", "0", *turn]) for k in range(3)]
    (tmp_path / "t.csv").write_text("\n".join([head, *rows]))
    assert stored_poses(tmp_path / "t.csv").unit == stated
    for unit in ("mm", "cm", "m"):
        if stated in ("", unit) or unit != "m":  # the unit of an option is the one that is read
            moved = read_trajectory(tmp_path / "t.csv", unit).poses[2].translation
            assert np.allclose(np.abs(moved), (2 * {"mm": 1, "cm": 10, "m": 1000}[unit], 0, 0))
        else:
            with pytest.raises(InputError, match=f"states positions in {stated}.*use --trajectory-unit {stated}"):
                read_trajectory(tmp_path / "t.csv", unit)


def test_a_name_in_a_column_that_is_not_used_is_not_the_reason(tmp_path):
    """The number that is not finite is; the name of the frame is read over."""
    (tmp_path / "t.csv").write_text("t,frame_id,x,y,z,qx,qy,qz,qw\n0,map,nan,0,0,0,0,0,1\n")
    with pytest.raises(InputError, match="line 2: use 8 finite numbers") as caught:
        stored_poses(tmp_path / "t.csv")
    assert "no number" not in str(caught.value)
