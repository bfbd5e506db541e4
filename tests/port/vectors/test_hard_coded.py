"""Every setting that a port has to read moves in the cases, and no fixed value of it passes."""

import pytest

from endotsr.port.judge.store import golden_folder, read_golden
from makers import hard_coded
from makers.registry import DECLARED

GOLDEN = read_golden(golden_folder())
GOLDEN = GOLDEN._replace(cases=sorted(GOLDEN.cases, key=lambda case: case.level))
WANTED = hard_coded.wanted_settings()


def test_every_setting_takes_two_values():
    """Before a port is asked, which takes minutes."""
    for setting, published in WANTED.items():
        values = hard_coded.values_of(hard_coded.held_by(GOLDEN, setting), published)
        fault = hard_coded.Row(setting, dict.fromkeys(values, "")).fault
        assert len(values) >= 2, fault


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("setting", WANTED)
def test_no_fixed_value_of_a_setting_passes(setting, precision):
    row = hard_coded.row_of(GOLDEN, setting, WANTED[setting], precision)
    assert not row.fault, row.fault


def test_a_setting_that_no_case_moves_is_a_gap():
    plain = GOLDEN._replace(cases=[case for case in GOLDEN.cases if case.case in ("paper", "three_steps")])
    row = hard_coded.row_of(plain, "model.beta", 0.3)
    assert row.gaps == ["0.3"] and row.fault.startswith("model.beta: the cases give ['0.3'] only; give it two values")


def test_a_fault_names_the_list_with_the_remedy():
    one = hard_coded.Row("loss.new", {"0.0": ""})
    assert "a line 'loss.new' with the reason to `free` of its operation in that family; a setting of no" in one.fault
    assert one.fault.endswith(" to GENERAL of golden/makers/hard_coded.py")
    assert "always uses ['1.0'] passes; " in hard_coded.Row("loss.new", {"0.0": "adam/a", "1.0": ""}).fault
    assert hard_coded.Row("loss.new", {"0.0": "adam/a", "1.0": "adam/b"}).fault == ""


def test_what_is_left_out_is_a_setting_and_has_a_reason():
    config = hard_coded.msgspec.to_builtins(hard_coded.Config())
    known = {f"{section}.{key}" for section in hard_coded.SECTIONS for key in config[section]}
    assert hard_coded.FREE.keys() <= known and all(hard_coded.FREE.values())
    assert set(config) - set(hard_coded.SECTIONS) == {"preset", "sequence"}


def test_a_setting_with_another_name_is_one_of_the_cases_and_stands_for_one_that_they_move():
    held = {(case.operation, name) for case in GOLDEN.cases for name in case.settings}
    stands_for = {(op, name): key for op, one in DECLARED.items() for name, key in one.settings.items()}
    assert len(stands_for) > 8 and stands_for.keys() <= held and set(stands_for.values()) <= WANTED.keys()
