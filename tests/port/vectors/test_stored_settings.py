"""The settings that cases store: those of the method, and what differs from its default."""

import msgspec
import pytest

from endotsr.config import Config, InitialisationConfig
from endotsr.port.judge.store import golden_folder, read_golden
from makers.registry import all_specs
from makers.settings import OF_THE_INITIALISATION, READ, section_of, written, written_section

GOLDEN = read_golden(golden_folder())
SECTIONS = [name for name in Config.__struct_fields__ if name != "preset"]


def longer(section, **values):
    """A section with one setting more, as a later version has it."""
    kind = msgspec.defstruct("Longer", [("added", int, 3)], bases=(type(section),), frozen=True, kw_only=True)
    return kind(**msgspec.structs.asdict(section), **values)


@pytest.mark.parametrize("name", SECTIONS)
def test_a_setting_that_is_added_changes_no_case_unless_a_case_gives_it_another_value(name):
    before = Config()
    after = msgspec.structs.replace(before, **{name: longer(getattr(before, name))})
    assert written(after) == written(before)
    other = msgspec.structs.replace(before, **{name: longer(getattr(before, name), added=4)})
    assert written(other)[name]["added"] == 4


def test_what_differs_from_the_default_is_stored():
    drawn = InitialisationConfig(first_frame_points=7)
    assert written_section(drawn, OF_THE_INITIALISATION) == {"first_frame_points": 7, "motion_threshold": 40.0}
    config = msgspec.structs.replace(Config(), training=msgspec.structs.replace(Config().training, seed=5))
    assert written(config)["training"]["seed"] == 5 and "sequence" not in written(config)


def test_every_listed_key_is_a_setting():
    for name, keys in READ.items():
        assert set(keys) <= set(type(getattr(Config(), name)).__struct_fields__), name


def test_the_cases_store_these_settings():
    specs = {spec.name: spec for spec in all_specs()}
    assert all(case.settings == specs[case.name].settings for case in GOLDEN.cases)
    whole = [case.settings["config"] for case in GOLDEN.cases if "config" in case.settings]
    assert len(whole) >= 14 and not any("sequence" in config for config in whole)
    for config in whole:
        for name in READ:
            assert set(READ[name]) <= set(config[name])


def test_a_section_has_the_order_of_the_configuration():
    loss = Config().loss
    assert list(section_of(loss, READ["loss"])) == [key for key in loss.__struct_fields__ if key in READ["loss"]]
