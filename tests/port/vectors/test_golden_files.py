"""The vectors themselves: complete, small, rebuilt from their recipes, and every changed byte is noticed."""

import inspect
import re
import shutil
from typing import get_args, get_type_hints

import msgspec
import numpy as np
import pytest

import house
import make
from endotsr.errors import InputError
from endotsr.method.splatting.fast.blocks import supports
from endotsr.port.contract import all_operations
from endotsr.port.gradcheck import all_pairs
from endotsr.port.judge.format import FLIP_BUDGET, Rule, schema_text
from endotsr.port.judge.npy import npy_bytes
from endotsr.port.judge.schemas import SCHEMAS
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.judge.words import fnv1a, words
from endotsr.port.operations.requests import raster_of
from endotsr.port.reference import reference
from makers import generate
from makers.generate import all_specs, check, moved, solve_all, solve_these
from makers.making import single
from makers.registry import all_wrong_ports
from makers.solve import MARGIN

FOLDER = golden_folder()


WHOLE = ("objective", "render_exact", "render_paper", "render_blocks")  # what level 3 is about


@pytest.mark.parametrize("pair", list(all_pairs()))
def test_every_registered_pair_has_a_case_forward_and_in_reverse(pair, golden):
    levels = (3,) if pair in WHOLE else (1, 2)
    outputs = [(n, o.level) for case in golden.cases if pair in case.pairs for n, o in case.outputs.items()]
    forward = {level for name, level in outputs if not name.startswith("d_")}
    reverse = {level for name, level in outputs if name.startswith("d_")}
    assert levels[0] in forward and levels[-1] in reverse


def test_no_case_names_a_pair_that_does_not_exist(golden):
    assert {pair for case in golden.cases for pair in case.pairs} == set(all_pairs())


def test_every_operation_and_level_has_a_case(golden):
    assert {case.operation for case in golden.cases} == set(all_operations())
    assert {o.level for case in golden.cases for o in case.outputs.values()} == {0, 1, 2, 3, 4, 5}


def test_the_choices_of_the_method_are_all_there(golden):
    def chosen(*keys):
        found = set()
        for case in golden.cases:
            value = case.settings
            for key in keys:
                value = value.get(key) if isinstance(value, dict) else None
            found.add(value)
        return found - {None}

    assert chosen("basis") == {"quartic", "gaussian"}
    assert chosen("upsampling") == chosen("loss", "upsampling") == {"co_sited", "half_pixel"}
    assert chosen("degree") == {0, 1, 2, 3}
    assert chosen("raster", "support") == {"everywhere", "ellipse", "three_sigma_tiles"}


def test_the_folder_is_small():
    size = house.golden_bytes()
    assert size < house.LARGEST_GOLDEN, f"golden/ has {size} bytes: smaller or fewer cases, or a larger limit there"


def test_raw_reading_needs_no_header(golden):
    for entry in golden.manifest.files:
        if entry.offset is None:
            continue
        raw = (FOLDER / entry.path).read_bytes()[entry.offset :]
        assert entry.dtype is not None and entry.shape is not None
        array = np.frombuffer(raw, entry.dtype).reshape(entry.shape)
        assert npy_bytes(array) == (FOLDER / entry.path).read_bytes()


def test_real_inputs_are_float32_numbers(golden):
    for case in golden.cases:
        for array in case.inputs.values():
            value = golden.array(case, array.file)
            if array.dtype == "real":
                assert np.array_equal(value, single(value), equal_nan=True), (case.name, array.file)


def test_uniform_inputs_are_rebuilt_with_integers_alone(golden):
    """The generator written once more, in Python integers, from the text of the README."""
    rebuilt = 0
    for case in golden.cases:
        for array in case.inputs.values():
            recipe = re.fullmatch(r"uniform\((.+), (.+)\) seed (\S+)", array.recipe)
            if not recipe:
                continue
            seed = 0xCBF29CE484222325
            for byte in recipe[3].encode():
                seed = (seed ^ byte) * 0x100000001B3 % 2**64
            value, low, high = [], float(recipe[1]), float(recipe[2])
            for k in range(int(np.prod(array.shape))):
                z = (seed + (k + 1) * 0x9E3779B97F4A7C15) % 2**64
                z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 % 2**64
                z = (z ^ z >> 27) * 0x94D049BB133111EB % 2**64
                z ^= z >> 31
                value.append(low + (high - low) * ((z >> 40) / 2**24))
            wanted = np.float32(np.array(value)).reshape(array.shape)
            assert np.array_equal(golden.array(case, array.file), wanted), (case.name, array.file)
            rebuilt += 1
    assert rebuilt > 100


def test_first_words_of_splitmix64():
    """Published first outputs of splitmix64 for seed 1234567."""
    assert words(1234567, 3).tolist() == [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert fnv1a("a") == 0xAF63DC4C8601EC8C


def test_tolerances_lie_far_below_the_mistakes(golden):
    for case in golden.cases:
        for flag in case.flags:
            shown = case.mistakes[flag].shown("float32")
            assert any(
                one.distance is None
                or case.outputs[name].compare.kind in ("exact", "identical", FLIP_BUDGET)
                or one.distance >= 0.99 * MARGIN * case.outputs[name].compare.float32
                for name, one in shown.items()
            ), (case.name, flag)
        for name, output in case.outputs.items():
            if output.because is not None:
                smallest = output.because.smallest_mutant
                assert (
                    smallest is None
                    or output.compare.kind in (FLIP_BUDGET, "identical")
                    or (output.compare.float64 <= output.compare.float32 <= 1.01 * smallest / MARGIN)
                ), (case.name, name)
                assert output.compare.float32 >= output.because.spread_float32, (case.name, name)
                assert output.compare.float64 >= output.because.spread_float64, (case.name, name)


RASTERISED = ("composite", "render", "objective")


def test_no_decision_hangs_on_rounding(golden):
    """Thresholds moved by 1e-5 either way leave every image as it is, but in the case that stands on the cutoff."""
    operations = all_operations()
    for case in golden.cases:
        if case.operation not in RASTERISED or case.case in ("on_the_cutoff", "one_on_the_cutoff"):
            continue
        inputs = {name: golden.array(case, a.file) for name, a in case.inputs.items()}
        for factor in (1 - 1e-5, 1 + 1e-5):
            moved_to = {name: case.settings["raster"][name] * factor
                        for name in ("alpha_cutoff", "transmittance_stop", "near")}  # fmt: skip
            settings = case.settings | {"raster": case.settings["raster"] | moved_to}
            found = reference(operations[case.operation], inputs, settings, "float64", "definition")
            for name in ("colour_image", "depth_image"):
                expected = golden.array(case, case.outputs[name].file)
                assert np.abs(found[name] - expected).max() < 1e-6, (case.name, name)


def test_no_densification_hangs_on_rounding(golden):
    """Thresholds moved by 1e-5 leave every decision as it is; what stands exactly on one counts, as it should."""
    operation = all_operations()["density"]
    for case in golden.cases:
        if case.operation != "density":
            continue
        inputs = {name: golden.array(case, a.file) for name, a in case.inputs.items()}
        ups = ("prune_opacity", "dense_fraction") if case.case != "on_the_thresholds" else ()
        for moved_to in ({n: case.settings["density"][n] * f for n in ups} | {"gradient_threshold": 0.25 * (1 - 1e-5)}
                         for f in (1 - 1e-5, 1 + 1e-5)):  # fmt: skip
            settings = case.settings | {"density": case.settings["density"] | moved_to}
            found = reference(operation, inputs, settings, "float64", "definition")
            for name in ("pruned", "cloned", "split", "parent"):
                assert np.array_equal(found[name], golden.array(case, case.outputs[name].file)), (case.name, name)


def test_the_contract_explains_every_operation_and_rule(golden):
    text = (FOLDER / "README.md").read_text()
    kinds = {o.compare.kind for case in golden.cases for o in case.outputs.values()}
    assert kinds == set(get_args(get_type_hints(Rule)["kind"]))
    assert [word for word in kinds | set(all_operations()) if f"`{word}`" not in text] == []


def test_schemas_describe_the_files():
    for name, kind in SCHEMAS.items():
        assert (FOLDER / "schemas" / f"{name}.schema.json").read_text() == schema_text(kind)
    assert "$ref" in schema_text(SCHEMAS["case"]) and msgspec.json.decode(schema_text(SCHEMAS["case"]))


def test_a_schema_does_not_depend_on_the_indentation_that_msgspec_keeps(monkeypatch):
    """msgspec 0.23 and Python 3.13 remove the indentation of a docstring; earlier versions keep it."""
    before = schema_text(SCHEMAS["case"])
    plain = msgspec.json.schema(SCHEMAS["case"])
    rule = plain["$defs"]["Rule"]
    rule["description"] = inspect.cleandoc(rule["description"])
    monkeypatch.setattr(msgspec.json, "schema", lambda kind: plain)
    assert "\nband " in rule["description"] and schema_text(SCHEMAS["case"]) == before


@pytest.fixture
def copy(tmp_path):
    target = tmp_path / "golden"
    shutil.copytree(FOLDER, target)
    return target


def test_the_manifest_has_the_checksum_of_every_generated_file(golden):
    there = {p.relative_to(FOLDER).as_posix() for r in ("cases", "schemas") for p in (FOLDER / r).rglob("*.*")}
    assert {entry.path for entry in golden.manifest.files} == there | {"negative/flags.json"}


def test_one_changed_byte_is_noticed(copy):
    for entry in read_golden(copy, verify=False).manifest.files[::97]:
        path = copy / entry.path
        data = bytearray(path.read_bytes())
        data[-1] ^= 1
        path.write_bytes(data)
        with pytest.raises(InputError, match="checksum"):
            read_golden(copy)
        data[-1] ^= 1
        path.write_bytes(data)
    read_golden(copy)


def test_a_missing_file_is_noticed(copy):
    (copy / "cases/motion/generic/expected/translation.npy").unlink()
    with pytest.raises(InputError, match="incomplete"):
        read_golden(copy)


def test_regeneration_says_what_moved(copy):
    (one,) = solve_these([spec for spec in all_specs() if spec.name == "motion/generic"], None)
    assert moved(copy, one) == []
    path = copy / "cases/motion/generic/expected/translation.npy"
    path.write_bytes(npy_bytes(one.expected[0]["translation"] * 1.001))
    (line,) = moved(copy, one)
    assert line.startswith("motion/generic/translation: ") and "e-0" in line and "tolerance" not in line


@pytest.mark.parametrize(("flag", "said"), [
    ("motion_cosines_dropped", "not examined: motion_cosines_dropped; .* whose `operations` name masked_l1"),
    ("sign_of_zero", "does not show sign_of_zero: .*; choose inputs on which it does, or leave out the flag"),
])  # fmt: skip
def test_a_flag_whose_mistake_a_case_does_not_show_is_named_with_the_reason(flag, said):
    """A mistake that another table declares is not examined until it names the operation."""
    (spec,) = [spec for spec in all_specs() if spec.name == "masked_l1/generic"]
    wrong_ports = [port for name, port in all_wrong_ports().items() if name in (*spec.flags, flag)]
    with pytest.raises(InputError, match=f"masked_l1/generic: {said}"):
        solve_these([spec._replace(flags=(*spec.flags, flag))], wrong_ports)


def test_one_family_is_written_alone_and_other_bits_are_not_noise(copy):
    """A value that is off by one bit keeps its bytes; a lost and a wrong one are made again; nothing else moves."""
    before = {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()}
    stored = copy / "cases/motion/generic/expected/translation.npy"
    value = np.load(stored)
    lost, wrong = stored.with_name("d_phi.npy"), stored.with_name("d_motion_coefficients.npy")
    stored.write_bytes(npy_bytes(np.nextafter(value, np.inf)))
    noisy = stored.read_bytes()
    lost.unlink()
    wrong.write_bytes(npy_bytes(1.001 * np.load(wrong)))
    assert make.main(["write", "motion", "--golden", str(copy)]) == 1
    after = {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()}
    assert after.keys() == before.keys() and after[stored] == noisy
    np.testing.assert_allclose(np.load(lost), np.load(FOLDER / lost.relative_to(copy)), rtol=1e-12)
    np.testing.assert_allclose(np.load(wrong), np.load(FOLDER / wrong.relative_to(copy)), rtol=1e-12)
    changed = {p.relative_to(copy).as_posix() for p in before if after[p] != before[p]}
    case = "cases/motion/generic"
    paths = ("case.json", "expected/translation.npy", "expected/d_phi.npy", "expected/d_motion_coefficients.npy")
    assert changed <= {"manifest.json", *(f"{case}/{path}" for path in paths)}
    read_golden(copy)  # checksums and all
    with pytest.raises(SystemExit, match="'motoin' is no family and no case; families: adam, "):
        make.main(["write", "motoin", "--golden", str(copy)])


def test_one_case_is_checked_alone(copy, capsys):
    """A wrong value of the case is named; one of another case is not read again."""
    command = ["check", "masked_l1/equal", "--within-tolerance", "--golden", str(copy)]
    assert make.main(command) == 0 and "golden: 1 cases compared within tolerance" in capsys.readouterr().out
    (other,) = copy.glob("cases/motion/generic/expected/translation.npy")
    other.write_bytes(npy_bytes(2 * np.load(other)))
    assert make.main(command) == 0
    wrong = copy / "cases/masked_l1/equal/expected/d_rendered.npy"
    wrong.write_bytes(npy_bytes(np.load(wrong) + 1))
    assert make.main(command) == 1 and "masked_l1/equal/d_rendered: " in capsys.readouterr().out
    other.unlink()
    with pytest.raises(SystemExit, match=r"error: .*translation\.npy: cannot be read: .*; name no family"):
        make.main(command)
    with pytest.raises(SystemExit, match="check: 'masked_l2' is no family and no case; families: adam, "):
        make.main(["check", "masked_l2", "--golden", str(copy)])


@pytest.mark.slow
def test_the_folder_equals_a_fresh_computation_and_writing_ends_with_exit_code_1(copy, monkeypatch):
    solved = solve_all()
    monkeypatch.setattr(generate, "solve_all", lambda mistakes=True: solved)  # computed once for all that follows
    lines, summary = check(FOLDER, bitwise=False)
    assert not lines, (summary, lines[:10])
    (copy / "cases/motion/generic/expected/translation.npy").unlink()
    assert make.main(["write", "--golden", str(copy)]) == 1
    assert make.main(["check", "--golden", str(copy)]) == 0


@pytest.mark.parametrize("operation", ["composite", "render"])
def test_the_reference_answers_by_two_paths(golden, operation):
    """They differ in their last bits; a name that no path has is refused."""
    cases = [case for case in golden.cases if case.operation == operation]
    case = next(case for case in cases if supports(raster_of(case.settings)))
    inputs = {name: golden.array(case, array.file) for name, array in case.inputs.items()}
    answers = [
        reference(all_operations()[operation], inputs, case.settings, "float32", p) for p in ("definition", "blocks")
    ]
    assert any(answers[0][name].tobytes() != answers[1][name].tobytes() for name in answers[0])
    with pytest.raises(ValueError, match="'rows' is not known; use definition or blocks"):
        reference(all_operations()[operation], inputs, case.settings, "float32", "rows")
