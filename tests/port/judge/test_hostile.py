"""Whatever a port leaves in its folder, the judge answers with a verdict a case: no crash, no code is run."""

import os
import pickle
import re
import struct

import msgspec
import numpy as np
import pytest

from endotsr.port.judge.npy import LONGEST_HEADER, Refused, npy_bytes, read_plain
from endotsr.port.judge.report import MOST_MISSING, as_html, as_json, as_table
from endotsr.port.judge.store import golden_folder
from endotsr.port.judge.verdict import judge

RIGHT = np.zeros((3, 7))


def header(text: str, body: bytes = b"", version: int = 1) -> bytes:
    raw = text.encode("latin-1")
    size = struct.pack("<H" if version == 1 else "<I", len(raw))
    return b"\x93NUMPY" + bytes([version, 0]) + size + raw + body


def plain(descr="<f8", fortran="False", shape="(3, 7)") -> str:
    return f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}"


class Bomb:
    def __reduce__(self):
        return (os.system, ("touch exploded",))


BAD = {
    "empty": (b"", "not a .npy"),
    "text": (b"hello", "not a .npy"),
    "pickle": (pickle.dumps(Bomb()), "not a .npy"),
    "object array": (header(plain("|O", shape="(1,)"), pickle.dumps(Bomb())), "object array"),
    "huge header": (header("x" * (LONGEST_HEADER + 1), version=2), "header of"),
    "header lies": (b"\x93NUMPY\x01\x00\xff\xff{    ", "header of"),
    "short header": (b"\x93NUMPY\x01\x00\x40\x00{    ", "ends inside"),
    "code in header": (header("__import__('os').system('touch exploded')"), "not that of a plain array"),
    "deep header": (header("(" * 3000), "not that of a plain array"),
    "huge shape": (header(plain(shape="(999999999999, 999999999999)")), "bytes; use"),
    "negative shape": (header(plain(shape="(-1, 7)")), "not that of a plain array"),
    "wrong length": (header(plain(), b"\x00" * 8), "bytes; header"),
    "too long": (header(plain(), b"\x00" * (8 * 21 + 1)), "bytes; header"),
    "big endian": (header(plain(">f8"), b"\x00" * 168), "big-endian"),
    "fortran": (header(plain(fortran="True"), b"\x00" * 168), "Fortran"),
    "complex": (header(plain("<c16", shape="(3, 3)"), b"\x00" * 144), "dtype"),
    "text array": (header(plain("<U5", shape="(1,)"), b"\x00" * 20), "dtype"),
    "structured": (header("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3, 7), }"), "plain array"),
    "integers": (npy_bytes(RIGHT.astype(np.int64)), "expected real"),
    "shape": (npy_bytes(np.zeros((7, 3))), r"shape \(7, 3\)"),
    "scalar": (npy_bytes(np.array(1.0)), "shape"),
    "nan": (npy_bytes(np.full((3, 7), np.nan)), "not finite"),
    "inf": (npy_bytes(np.full((3, 7), np.inf)), "not finite"),
    "zeros": (npy_bytes(RIGHT), "of scale"),
    "boolean bytes": (header(plain("|b1"), b"\x01" * 20 + b"\x02"), "a boolean byte other than 0 and 1"),
    "version 9": (header(plain(), b"\x00" * 168, version=9), "version"),
}  # fmt: skip


@pytest.mark.parametrize("name", list(BAD))
def test_a_bad_file_is_one_refused_output(name, golden, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data, reason = BAD[name]
    path = tmp_path / "motion" / "generic" / "translation.npy"
    path.parent.mkdir(parents=True)
    path.write_bytes(data)
    report = judge(golden, tmp_path, "float32", level=1)
    case = next(c for c in report.cases if c.name == "motion/generic")
    (output,) = [o for o in case.outputs if o.name == "translation"]
    assert output.status == "refused"
    assert re.search(reason, output.reason), output.reason
    assert not (tmp_path / "exploded").exists() and report.level == -1
    as_table(report), as_json(report), as_html(report, golden, tmp_path)


def test_an_empty_folder_is_missing_everywhere(golden, tmp_path):
    report = judge(golden, tmp_path, "float64")
    assert {c.status for c in report.cases} == {"missing"} and report.claim == "no level is complete"
    long = msgspec.structs.replace(report, cases=[case for case in report.cases if len(case.outputs) > MOST_MISSING])
    line = next(line for line in as_table(long).splitlines() if line.startswith(f"  {long.cases[0].name}: "))
    assert line.count(",") == MOST_MISSING and line.endswith(f", {len(long.cases[0].outputs) - MOST_MISSING} more")
    assert not re.search(r", \d+ more\n", as_table(long, everything=True))


def test_links_pipes_and_folders_are_not_opened(golden, tmp_path):
    outputs, secret = tmp_path / "outputs", tmp_path / "secret.npy"
    secret.write_bytes((golden_folder() / "cases/motion/generic/expected/translation.npy").read_bytes())
    folder = outputs / "motion" / "generic"
    folder.mkdir(parents=True)
    (folder / "translation.npy").symlink_to(secret)
    os.mkfifo(folder / "d_phi.npy")
    (folder / "d_motion_coefficients.npy").mkdir()
    (outputs / "dictionary").symlink_to(golden_folder() / "cases" / "dictionary")
    (outputs / "matern").write_bytes(b"a file where a folder should be")
    (outputs / "atoms").symlink_to(outputs / "atoms")
    report = judge(golden, outputs, "float64", level=2)
    case = next(c for c in report.cases if c.name == "motion/generic")
    assert [o.status for o in case.outputs] == ["refused"] * 3, case.outputs
    assert not any(c.status == "passed" for c in report.cases)


def test_a_link_inside_the_folder_is_refused_too(tmp_path):
    (tmp_path / "a.npy").write_bytes(npy_bytes(RIGHT))
    (tmp_path / "b.npy").symlink_to(tmp_path / "a.npy")
    assert read_plain(tmp_path / "a.npy", tmp_path).shape == (3, 7)
    with pytest.raises(Refused):
        read_plain(tmp_path / "b.npy", tmp_path)


def test_names_in_the_report_are_escaped(golden, tmp_path):
    report = judge(golden, tmp_path, "float64", level=0)
    report.cases[0].title = "<script>alert(1)</script>"
    assert "<script>alert" not in as_html(report, golden, tmp_path)


LEFT_OUT = {
    "no operation": (b"nothing_of_this_name\n\x1b[31mred", r"no operation '\\x1b\[31mred'"),
    "not text": (b"\xff\xfe\x00", "not UTF-8"),
    "huge": (b"motion\n" * 1000, "longer than"),
}


@pytest.mark.parametrize("name", list(LEFT_OUT))
def test_a_bad_list_of_operations_left_out_leaves_out_nothing(name, golden, tmp_path):
    data, reason = LEFT_OUT[name]
    (tmp_path / "not_ported.txt").write_bytes(data)
    report = judge(golden, tmp_path, "float32", level=2)
    assert report.without == () and {c.status for c in report.cases} == {"missing"}
    assert any(re.search(reason, note) for note in report.notes), report.notes


def test_a_port_that_leaves_out_everything_claims_nothing(golden, tmp_path):
    (tmp_path / "not_ported.txt").write_text("\n".join({case.operation for case in golden.cases}))
    report = judge(golden, tmp_path, "float32")
    assert report.level == -1 and not report.passed and report.claim == "no level is complete"
    as_table(report), as_json(report), as_html(report, golden, tmp_path)


def test_the_list_of_what_is_left_out_is_not_read_through_a_link(golden, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "list").write_text("motion\n")
    (tmp_path / "outputs").mkdir()
    (tmp_path / "outputs" / "not_ported.txt").symlink_to(tmp_path / "elsewhere" / "list")
    assert judge(golden, tmp_path / "outputs", "float32", level=1).without == ()
