"""Every row of `inputs_tried.py`: nothing is wrong in silence, and each outcome is the expected one."""

import pytest
from command_inputs import given, keys
from inputs_tried import ROWS, tried
from stereo_inputs import matched, textured

from endotsr.cli.main import main


def test_the_table_is_long_enough_and_names_every_input_once():
    assert len(ROWS) >= 500 and len({row.kind for row in ROWS}) == len(ROWS)


@pytest.mark.parametrize("row", ROWS, ids=[row.kind for row in ROWS])
def test_an_input_has_its_outcome(row, tmp_path):
    found = tried(row, tmp_path)
    assert found.outcome == row.expected, found
    assert row.said in found.message or found.outcome == "right", found
    written = found.command.startswith("endotsr prepare") and (tmp_path / "o").exists()
    assert not (found.outcome == "refused" and written), "a refusal leaves nothing"


@pytest.mark.parametrize("make", [given(1), matched(lambda i: textured(i, 12)), keys(255, 0)])
def test_right_inputs_of_the_commands_give_no_warning(make, tmp_path, capsys):
    words = make(tmp_path)
    capsys.readouterr()
    assert main(words) == 0
    assert "warning" not in capsys.readouterr().out
