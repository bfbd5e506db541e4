"""Every family holds its operations, cases and mistakes together, and the published order is kept."""

from pathlib import Path

import msgspec
import pytest

from endotsr.errors import InputError
from endotsr.port.contract import all_operations
from endotsr.port.judge.about import axes_of
from endotsr.port.judge.format import Manifest, read_struct
from endotsr.port.judge.store import golden_folder, read_golden
from makers import registry
from makers.files import fresh_files, rendered_files
from makers.generate import solve_these, version_of
from makers.registry import FAMILIES, all_specs, all_wrong_ports, families
from makers.wrong import wrong_ports

PUBLISHED = read_struct(golden_folder() / "manifest.json", Manifest)


@pytest.mark.parametrize("family", families(), ids=FAMILIES)
def test_a_family_has_cases_and_mistakes_of_its_own_operations(family):
    assert {spec.operation for spec in family.cases()} == set(family.OPERATIONS)
    for wrong_port in wrong_ports(family.__name__.removeprefix("makers.")):
        assert set(wrong_port.operations) <= set(all_operations()), wrong_port.flag
        assert set(wrong_port.operations) & set(family.OPERATIONS), f"{wrong_port.flag} breaks no rule of this family"


def test_every_operation_is_in_a_family():
    assert {name for family in families() for name in family.OPERATIONS} == set(all_operations())


def test_every_module_with_cases_is_a_family():
    modules = Path(registry.__file__).parent.glob("*.py")
    assert {file.stem for file in modules if "\ndef cases(" in file.read_text(encoding="utf-8")} == set(FAMILIES)


def test_every_operation_is_declared_in_one_family_which_has_cases_of_it(monkeypatch):
    declaring = [family for family in families() if hasattr(family, "DECLARED")]
    assert [name for family in declaring for name in family.OPERATIONS] == list(registry.DECLARED)
    assert registry.DECLARED.keys() == all_operations().keys()
    monkeypatch.setattr(registry, "FAMILIES", ("motion", "motion"))
    with pytest.raises(ValueError, match=r"^makers\.motion: operation motion is declared twice$"):
        registry.all_declared()


def test_the_cases_are_those_of_the_manifest():
    published = {f"{family}/{case}" for family, cases in PUBLISHED.families.items() for case in cases}
    assert {spec.name for spec in all_specs()} == published


def test_every_array_of_a_case_has_axes_for_the_request_to_a_port():
    lacking = {}
    for case in read_golden(golden_folder(), verify=False).cases:
        for name, array in (*case.inputs.items(), *case.outputs.items()):
            try:
                axes_of(name, len(array.shape))
            except KeyError as error:
                lacking[name] = error.args[0]
    assert not lacking


def test_an_array_without_axes_is_named_with_the_table_that_lacks_it():
    with pytest.raises(KeyError, match=r"'haze' with 2 axes is not in `_AXES` of .*port/judge/about\.py"):
        axes_of("d_haze", 2)


def test_another_version_than_that_of_the_files_is_refused_with_the_remedy(tmp_path):
    (tmp_path / "manifest.json").write_bytes((golden_folder() / "manifest.json").read_bytes())
    (tmp_path / "VERSION").write_text("99.0.0\n")
    with pytest.raises(InputError, match=r"VERSION says 99.0.0, .*; take both .*`python golden/make.py write`"):
        read_golden(tmp_path)


def test_the_version_is_the_newest_of_the_text_with_its_last_patch(tmp_path):
    assert f"{version_of(golden_folder())}\n" == (golden_folder() / "VERSION").read_text()
    (tmp_path / "README.md").write_text(
        "### 4.7\n\n- 4.7.2: a text.\n- 4.7.1: a text.\n\n### 4.6\n\n- 4.6.3: a text.\n"
    )
    assert version_of(tmp_path) == "4.7.2"


def test_a_flag_or_case_that_is_given_twice_is_refused(monkeypatch):
    monkeypatch.setattr(registry, "FAMILIES", ("motion", "motion"))
    with pytest.raises(ValueError, match="a golden case is named twice"):
        all_specs()
    with pytest.raises(ValueError, match="motion_cosines_dropped is named twice"):
        all_wrong_ports()


def test_a_mistake_of_another_family_has_the_changes_of_both_and_needs_a_title_in_one(monkeypatch):
    """`laplacian.toml` has its lines of a mistake of `masked_l1`, which comes later."""
    monkeypatch.setattr(registry, "FAMILIES", ("laplacian", "masked_l1"))
    mistake = all_wrong_ports()["sign_of_zero"]
    assert mistake.title and sorted(mistake.operations) == ["laplacian", "masked_l1"]
    assert {edit.module for edit in mistake.edits} == {"method.equations.laplacian", "method.losses.masked_l1"}
    monkeypatch.setattr(registry, "FAMILIES", ("laplacian",))
    with pytest.raises(ValueError, match="mean_of_nothing: no title"):
        all_wrong_ports()


@pytest.mark.slow
def test_what_is_published_keeps_its_place_and_what_is_new_follows():
    """Files, flags and mistakes, for a manifest that lists one of two cases of `laplacian` and two flags."""
    three = ("motion/generic", "laplacian/co_sited", "laplacian/tiny")
    ports = [port for port in all_wrong_ports().values() if "masked_l1" not in port.operations]
    solved = solve_these([spec for spec in all_specs() if spec.name in three], ports)
    names = ("laplacian/tiny", "motion/generic")
    files = tuple(next(f for f in PUBLISHED.files if f.path == f"cases/{name}/case.json") for name in names)
    flags = {flag: PUBLISHED.flags[flag] for flag in ("upsampling_swapped", "mask_before_pyramid")}
    before = msgspec.structs.replace(PUBLISHED, files=files, flags=flags)
    fresh = rendered_files([fresh_files(one) for one in solved], all_wrong_ports(), "1.0.0", before)
    manifest = msgspec.json.decode(fresh["manifest.json"], type=Manifest)
    assert manifest.families == {"laplacian": ("tiny", "co_sited"), "motion": ("generic",)}
    assert list(manifest.flags)[:2] == list(flags) and set(manifest.flags) == set(all_wrong_ports())
    case = msgspec.json.decode(fresh["cases/laplacian/co_sited/case.json"])
    assert list(case["mistakes"])[:2] == ["upsampling_swapped", "mask_before_pyramid"]
    assert next(iter(fresh)).startswith("cases/laplacian/tiny/")
