"""What a port in another repository receives: the archive of the vectors, the judge alone, the data wheel."""

import hashlib
import json
import subprocess
import sys
import zipfile

import msgspec
import pytest
from made_up_ports import command, three_functions

from endotsr.errors import InputError
from endotsr.port.judge.archive import unpacked
from endotsr.port.judge.format import Manifest, read_struct
from endotsr.port.judge.store import golden_folder, read_golden
from makers import plain_msgspec
from makers.delivery import pack, zipped

ARCHIVE = f"endotsr-golden-{(golden_folder() / 'VERSION').read_text().strip()}.zip"
READ_ALL = """
import json, sys
sys.path.insert(0, sys.argv[1])
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.judge.format import to_json
import endotsr.port.judge.__main__, endotsr.port.judge.report
from pathlib import Path
golden = read_golden(golden_folder(Path(sys.argv[2])))
texts = [json.loads(to_json(one)) for one in (golden.manifest, *golden.cases)]
files = {getattr(m, "__file__", None) or "" for m in sys.modules.values()}
outside = sorted(f for f in files if "site-packages" in f and "numpy" not in f and "_distutils" not in f)
print(json.dumps({"texts": texts, "outside": outside}))
"""


@pytest.fixture(scope="module")
def dist(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    pack(golden_folder(), folder)
    return folder


def judged(dist, folder, *words):
    """The judge alone, in a folder and without the package; returns exit code, output, errors."""
    done = subprocess.run([sys.executable, "-I", str(dist / "endotsr-golden.pyz"), *words], cwd=folder, check=False,
                          capture_output=True, text=True)  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_port_of_three_functions_is_judged_with_the_archive_beside_the_judge(dist, tmp_path, precision):
    words = ["run", "--port", command(), "--precision", precision, "--level", "2", "--json", "report.json"]
    code, out, err = judged(dist, tmp_path, *words)
    assert (code, err) == (0, "")
    assert f"level 2, {precision}, without " in out.splitlines()[-1]
    assert json.loads((tmp_path / "report.json").read_text())["level"] == 2


def test_a_mistake_is_refused_and_named_without_the_package(dist, tmp_path):
    wrong = command(three_functions(tmp_path, "(gain * d * inputs", "(d * inputs"))
    code, out, _ = judged(dist, tmp_path, "run", "--port", wrong, "--precision", "float64", "--level", "2")
    assert code == 1 and "first wrong: operation exposure, equation (B13), level 2" in out
    assert "endotsr golden" in out


def test_the_judge_alone_says_how_to_get_vectors(dist, tmp_path):
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "endotsr-golden.pyz").write_bytes((dist / "endotsr-golden.pyz").read_bytes())
    code, out, err = judged(alone, alone, "judge", ".")
    assert code == 2 and out == "" and "endotsr-golden-VERSION.zip" in err and "pack" in err


def test_plain_msgspec_reads_every_case_as_msgspec_does_and_loads_no_other_library(dist):
    golden = golden_folder()
    done = subprocess.run([sys.executable, "-I", "-c", READ_ALL, str(dist / "endotsr-golden.pyz"), str(golden)],
                          capture_output=True, text=True, check=True)  # fmt: skip
    found = json.loads(done.stdout)
    known = read_golden(golden)
    assert found["texts"] == [json.loads(msgspec.json.encode(one)) for one in (known.manifest, *known.cases)]
    assert len(found["texts"]) == 1 + len(known.cases) and found["outside"] == []


class Inner(plain_msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    kind: str
    sizes: tuple[int, ...] = ()
    limit: float | None = None


@pytest.mark.parametrize(
    "text",
    ['{"kind": 1}', "{}", '{"kind": "a", "more": 1}', '{"kind": "a", "sizes": [1.5]}', '{"kind": "a", "sizes": [true]}',
     '{"kind": "a", "limit": NaN}', '{"kind": "a", "limit": "1"}', "[]", '{"kind": "a"', '{"kind": "a", "sizes": {}}'],
)  # fmt: skip
def test_plain_msgspec_refuses_what_msgspec_refuses(text):
    class Same(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
        kind: str
        sizes: tuple[int, ...] = ()
        limit: float | None = None

    with pytest.raises(msgspec.DecodeError):
        msgspec.json.decode(text, type=Same)
    with pytest.raises(plain_msgspec.DecodeError):
        plain_msgspec.json.decode(text, type=Inner)
    assert plain_msgspec.json.decode('{"kind": "a", "limit": 1}', type=Inner) == Inner(kind="a", limit=1.0)


def test_the_archive_has_the_vectors_and_its_hash_and_is_the_same_bytes_again(dist, tmp_path):
    data = (dist / ARCHIVE).read_bytes()
    assert (dist / f"{ARCHIVE}.sha256").read_text().split() == [hashlib.sha256(data).hexdigest(), ARCHIVE]
    again = {path.name: path.read_bytes() for path in pack(golden_folder(), tmp_path)}
    assert again == {path.name: path.read_bytes() for path in dist.iterdir()}
    folder = unpacked(dist / ARCHIVE)
    assert [case.name for case in read_golden(folder).cases] == [
        case.name for case in read_golden(golden_folder()).cases
    ]
    assert read_struct(folder / "manifest.json", Manifest) == read_struct(golden_folder() / "manifest.json", Manifest)


@pytest.mark.parametrize(
    ("data", "said"),
    [(b"no archive", "no archive of vectors"), (zipped({"../outside": b"1"}), "begins with a dot"),
     (zipped({"/outside": b"1"}), "empty")],
)  # fmt: skip
def test_a_foreign_archive_is_refused(tmp_path, data, said):
    path = tmp_path / "a" / "b.zip"
    path.parent.mkdir()
    path.write_bytes(data)
    with pytest.raises(InputError, match=said):
        unpacked(path)
    assert not (tmp_path / "outside").exists()


def test_an_archive_that_differs_from_its_hash_is_refused(dist, tmp_path):
    path = tmp_path / ARCHIVE
    path.write_bytes((dist / ARCHIVE).read_bytes() + b"\n")
    (tmp_path / f"{ARCHIVE}.sha256").write_bytes((dist / f"{ARCHIVE}.sha256").read_bytes())
    with pytest.raises(InputError, match=r"differs from the hash in .*sha256"):
        unpacked(path)


def test_the_data_wheel_is_found_where_it_is_installed(dist, tmp_path):
    site = tmp_path / "site"
    (wheel,) = dist.glob("*.whl")
    with zipfile.ZipFile(wheel) as opened:
        opened.extractall(site)
        lines = opened.read(next(n for n in opened.namelist() if n.endswith("RECORD"))).decode().splitlines()
        assert {line.split(",")[0] for line in lines} == set(opened.namelist())
    script = (
        "import sys; sys.path[:0] = sys.argv[1:]; from endotsr.port.judge.store import golden_folder, read_golden; "
        "print(len(read_golden(golden_folder()).cases))"
    )
    words = [sys.executable, "-I", "-c", script, str(dist / "endotsr-golden.pyz"), str(site)]
    (tmp_path / "empty").mkdir()
    done = subprocess.run(words, cwd=tmp_path / "empty", capture_output=True, text=True, check=True)
    assert int(done.stdout) == len(read_golden(golden_folder()).cases)
