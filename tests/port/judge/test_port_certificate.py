"""A certificate: written for a complete level alone, confirmed by a second judgement, refused if it is changed."""

import json
import xml.etree.ElementTree as ET
from typing import get_args

import pytest
from made_up_ports import THREE, command, racing, three_functions
from matplotlib.font_manager import findfont
from matplotlib.ft2font import FT2Font

from endotsr.cli.golden import run
from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.port.judge.__main__ import main as judge_main
from endotsr.port.judge.badge import LEFT, badge, width, write_badge
from endotsr.port.judge.certificate import read_certificate, write_certificate
from endotsr.port.judge.format import Precision, schema_text, to_json
from endotsr.port.judge.profiles import PROFILES
from endotsr.port.judge.report import write_report
from endotsr.port.judge.schemas import SCHEMAS
from endotsr.port.judge.verdict import conclude

ASKED = ("--precision", "float64", "--level", "2")
WRONG_GRADIENT = ("d[:, None] * phi[:, None]", "d[:, None] + phi[:, None]")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("certificate")
    words = ["run", "--port", command(), *ASKED, "--name", "three <functions>"]
    assert run([*words, "--certificate", str(folder / "c.json"), "--badge", str(folder / "b.svg")]) == 0
    return folder


def test_a_certificate_says_what_was_judged(golden, written):
    found = read_certificate(written / "c.json")
    assert found.claim.startswith("golden 4.") and ", level 2, float64, without " in found.claim
    assert found.vectors == golden.manifest.version and len(found.manifest) == 64
    assert found.port.command == command() and found.port.name == "three <functions>" and found.port.commit
    assert found.cases >= 6 and found.outputs >= 20 and 0 < found.seconds < 600
    assert 0 <= found.tolerances.used <= 1 and found.tolerances.smallest <= found.tolerances.largest
    assert "motion" not in found.without and "adam" in found.without


def test_the_file_has_the_fields_of_its_schema(written):
    schema = json.loads(schema_text(SCHEMAS["certificate"]))
    record = schema["$defs"][schema["$ref"].rpartition("/")[2]]
    data = json.loads((written / "c.json").read_text())
    assert set(data) == set(record["properties"]) and record["additionalProperties"] is False


def test_the_badge_is_xml_with_the_claim_as_its_title(written):
    root = ET.fromstring((written / "b.svg").read_text())
    found = read_certificate(written / "c.json")
    assert root.find("{http://www.w3.org/2000/svg}title").text == found.claim
    texts = [one.text for one in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts == ["endotsr golden", f"{found.vectors[:3]}, level 2, float64, in part"]
    hostile = SCHEMAS["certificate"](
        **{**{n: getattr(found, n) for n in found.__struct_fields__}, "vectors": "<b>.1.0"}
    )
    ET.fromstring(badge(hostile))


@pytest.mark.parametrize("program", [main, judge_main])
def test_a_name_without_a_certificate_is_refused(program, tmp_path, capsys):
    """The badge does not show it. Before, it was ignored."""
    words = ["run", "--port", command(), "--name", "mine", "--badge", str(tmp_path / "b.svg")]
    assert program([*(["golden"] if program is main else []), *words]) == 2
    assert "--name has no effect without --certificate: it is the name of the port in" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_files_of_the_judge_are_written_in_one_step(written, golden, tmp_path, monkeypatch):
    """A link of the same name is replaced, not followed, and a page that cannot be made leaves the old one."""
    found, report = read_certificate(written / "c.json"), conclude(golden, [], "float64", 2, [])
    writers = {
        "c.json": lambda path: write_certificate(path, found),
        "b.svg": lambda path: write_badge(path, found),
        "r.json": lambda path: write_report(report, golden, tmp_path, path, None),
        "r.html": lambda path: write_report(report, golden, tmp_path, None, path),
    }
    (tmp_path / "mine").write_text("mine")
    for name, write in writers.items():
        (tmp_path / name).symlink_to("mine")
        write(tmp_path / name)
        assert not (tmp_path / name).is_symlink() and (tmp_path / name).stat().st_size > 100
    assert (tmp_path / "mine").read_text() == "mine"
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr("endotsr.untrusted.writing.rename", lambda *ends: (_ for _ in ()).throw(OSError("full")))
    for name, write in writers.items():
        with pytest.raises(OSError, match="full"):
            write(tmp_path / name)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


TITLES = ["", *(f"{profile.title}, " for profile in PROFILES.values())]


@pytest.mark.parametrize("title", TITLES)
def test_the_letters_of_a_badge_are_spread_by_8_percent_at_most_and_never_pressed(title):
    font = FT2Font(findfont("DejaVu Sans"))
    font.set_size(11, 72)
    ends = [f"level {k}, {precision}{less}" for k in range(6) for precision in get_args(Precision)
            for less in ("", ", in part")]  # fmt: skip
    for text in (LEFT, *(f"4.5, {title}{end}" for end in ends)):
        own = sum(font.load_char(ord(letter)).linearHoriAdvance for letter in text) / 65536
        assert own <= width(text) <= 1.08 * own, text


def test_verify_judges_again(written, tmp_path, capsys):
    words = ["verify", str(written / "c.json"), "--port"]
    assert run([*words, command()]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("confirmed: golden 4.")
    assert run([*words, command(three_functions(tmp_path, *WRONG_GRADIENT))]) == 1
    said = capsys.readouterr().out
    assert "claim: the certificate says 'golden" in said and said.endswith("differs from the certificate\n")
    less = three_functions(tmp_path, "frequencies, motion, exposure)", "frequencies, motion)")
    assert run([*words, command(less)]) == 1
    assert "without: " in capsys.readouterr().out


@pytest.mark.parametrize("name", ["smallest", "largest"])
def test_other_tolerances_are_a_difference(written, tmp_path, capsys, name):
    """Before, a certificate with any tolerances was confirmed."""
    data = json.loads((written / "c.json").read_text())
    data["tolerances"][name] *= 2
    (tmp_path / "c.json").write_text(json.dumps(data))
    assert run(["verify", str(tmp_path / "c.json"), "--port", command()]) == 1
    assert f"tolerances.{name}: the certificate says" in capsys.readouterr().out


def test_a_command_out_of_a_file_is_shown_and_not_run(written):
    with pytest.raises(InputError, match=r"not run.*three_functions"):
        run(["verify", str(written / "c.json")])


def test_the_runs_are_in_the_certificate_and_verified_again(tmp_path, capsys):
    words = ["run", "--port", racing(tmp_path, [0.0]), *ASKED, "--runs", "2"]
    assert run([*words, "--certificate", str(tmp_path / "c.json")]) == 0
    assert read_certificate(tmp_path / "c.json").runs == 2 and (tmp_path / "count").read_text() == "2"
    wrong = racing(tmp_path, [0.0, 0.0, 0.0, 0.5])  # the second run of the verification
    assert run(["verify", str(tmp_path / "c.json"), "--port", wrong]) == 1
    assert (tmp_path / "count").read_text() == "4" and "differs from the certificate" in capsys.readouterr().out


def test_a_certificate_of_one_run_needs_no_number_and_no_other_is_taken(written, tmp_path):
    data = json.loads((written / "c.json").read_text())
    assert data.pop("runs") == 1
    (tmp_path / "old.json").write_text(json.dumps(data))
    assert read_certificate(tmp_path / "old.json").runs == 1
    (tmp_path / "none.json").write_text(json.dumps(data | {"runs": 0}))
    with pytest.raises(InputError, match="runs: 0; use 1 to 1000"):
        read_certificate(tmp_path / "none.json")


def test_an_incomplete_level_has_no_certificate(tmp_path, capsys):
    wrong = three_functions(tmp_path, *WRONG_GRADIENT)
    words = ["run", "--port", command(wrong), *ASKED, "--search", "0"]
    assert run([*words, "--certificate", str(tmp_path / "c.json"), "--badge", str(tmp_path / "b.svg")]) == 1
    assert "no certificate" in capsys.readouterr().out
    assert not list(tmp_path.glob("c.json")) + list(tmp_path.glob("b.svg"))


def test_a_part_has_no_certificate(tmp_path, capsys):
    words = ["run", "--port", command(), *ASKED, "--only", "motion"]
    assert run([*words, "--certificate", str(tmp_path / "c.json")]) == 1
    assert "no certificate: no claim: only motion was judged" in capsys.readouterr().out
    assert not (tmp_path / "c.json").exists()


def test_a_part_is_refused_if_the_port_fails_after_right_outputs(tmp_path):
    failing = tmp_path / "failing.py"
    failing.write_text(f"import runpy, sys\nrunpy.run_path({str(THREE)!r}, run_name='__main__')\nsys.exit(3)\n")
    words = [*ASKED, "--only", "motion"]
    assert run(["run", "--port", command(), *words]) == 0
    assert run(["run", "--port", command(failing), *words]) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"level": 5}, "claim"),
        ({"claim": "golden 4.1, level 5, float64"}, "claim"),
        ({"without": []}, "claim"),
        ({"profile": "everything"}, "profile"),
        ({"level": 9}, "level"),
        ({"format": 2}, "format"),
        ({"more": 1}, "more"),
        ({"cases": 0}, "count below 1"),
        ({"seconds": -1.0}, "seconds"),
        ({"date": "yesterday"}, "date"),
        ({"date": "2026-11-26T16:31:03"}, "time zone"),
        ({"tolerances": {"smallest": 0.0, "largest": 1.0, "used": 2.0}}, "beyond its tolerance"),
        ({"port": {"name": "a\u202eb", "command": "x"}}, "control characters"),
        ({"port": {"name": "a", "command": "x" * 501}}, "longer"),
        ({"judge": "1\n2"}, "control characters"),
    ],
)
def test_a_changed_certificate_is_refused(written, tmp_path, change, said):
    data = json.loads((written / "c.json").read_text())
    path = tmp_path / "c.json"
    path.write_text(json.dumps(data | change))
    with pytest.raises(InputError, match=said):
        read_certificate(path)


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b"\xff\xfe", b"null", b"[" * 100_000, b'{"claim": NaN}'])
def test_a_damaged_certificate_is_refused(tmp_path, data):
    path = tmp_path / "c.json"
    path.write_bytes(data)
    with pytest.raises(InputError, match="no certificate"):
        read_certificate(path)


def test_a_certificate_of_other_vectors_is_not_compared(written, tmp_path):
    found = read_certificate(written / "c.json")
    other = SCHEMAS["certificate"](**{**{n: getattr(found, n) for n in found.__struct_fields__}, "manifest": "0" * 64})
    (tmp_path / "c.json").write_text(to_json(other))
    with pytest.raises(InputError, match="at hand are"):
        run(["verify", str(tmp_path / "c.json"), "--port", command()])
