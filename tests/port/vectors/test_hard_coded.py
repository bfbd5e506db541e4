"""Every setting that a port has to read moves in the cases, and no fixed value of it passes."""

import pytest

from endotsr.port.judge.store import golden_folder, read_golden
from makers import hard_coded

GOLDEN = read_golden(golden_folder())
GOLDEN = GOLDEN._replace(cases=sorted(GOLDEN.cases, key=lambda case: case.level))
WANTED = hard_coded.wanted_settings()


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("setting", WANTED)
def test_no_fixed_value_of_a_setting_passes(setting, precision):
    row = hard_coded.row_of(GOLDEN, setting, WANTED[setting], precision)
    assert len(row.refused_by) >= 2, f"{setting}: the cases give {list(row.refused_by)} only"
    assert row.gaps == [], f"{setting}: a port that always uses {row.gaps} passes"


def test_a_setting_that_no_case_moves_is_a_gap():
    plain = GOLDEN._replace(cases=[case for case in GOLDEN.cases if case.case in ("paper", "three_steps")])
    row = hard_coded.row_of(plain, "model.beta", 0.3)
    assert row.gaps == ["0.3"]


def test_what_is_left_out_is_a_setting_and_has_a_reason():
    config = hard_coded.msgspec.to_builtins(hard_coded.Config())
    known = {f"{section}.{key}" for section in hard_coded.SECTIONS for key in config[section]}
    assert hard_coded.FREE.keys() <= known and all(hard_coded.FREE.values())
    assert set(config) - set(hard_coded.SECTIONS) == {"preset", "sequence"}
