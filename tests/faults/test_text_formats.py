"""Hostile YAML, XML and TOML: every refusal is an InputError, and what is written is read again."""

import tomllib

import pytest

from endotsr.errors import InputError
from endotsr.untrusted.storage import DEEPEST, read_storage
from endotsr.untrusted.toml import toml_text
from endotsr.untrusted.yaml import read_yaml

VALUES = ("!!int ''", "!!float ''", "!!bool maybe", "!!timestamp never", "!!int 0x", "!!omap 3", "&x [*x]")
BOMB = "a0: &a0 [0, 0]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 40))


@pytest.mark.parametrize("value", VALUES)
def test_a_yaml_value_that_its_tag_does_not_allow_is_refused(value, tmp_path):
    (tmp_path / "a.yaml").write_text(f"a: {value}\n")
    with pytest.raises(InputError, match=r"a\.yaml: not YAML: "):
        read_yaml(tmp_path / "a.yaml")


def test_yaml_whose_aliases_multiply_is_refused_at_once(tmp_path):
    (tmp_path / "a.yaml").write_text(BOMB)
    with pytest.raises(InputError, match="aliases"):
        read_yaml(tmp_path / "a.yaml")


def test_a_yaml_alias_is_read(tmp_path):
    (tmp_path / "a.yaml").write_text("a: &x [1, 2]\nb: *x\n")
    assert read_yaml(tmp_path / "a.yaml") == {"a": [1, 2], "b": [1, 2]}


def nested(depth: int) -> str:
    return "<opencv_storage>" + "<a>" * depth + "1" + "</a>" * depth + "</opencv_storage>"


def test_xml_is_read_to_a_depth_and_refused_beyond_it(tmp_path):
    (tmp_path / "a.xml").write_text(nested(DEEPEST))
    assert read_storage(tmp_path / "a.xml")
    for depth in (DEEPEST + 1, 70_000):
        (tmp_path / "a.xml").write_text(nested(depth))
        with pytest.raises(InputError, match="nested more than"):
            read_storage(tmp_path / "a.xml")


def test_every_character_of_a_toml_text_is_read_again():
    text = "".join(map(chr, [*range(0x300), 0x2028, 0xFEFF, 0x1F600]))
    assert tomllib.loads(toml_text({"a": text})) == {"a": text}
