"""The port in C99, written from the text alone: it must compile without a warning and pass level 2."""

import shutil
import subprocess

import pytest

from endotsr.cli.golden import run
from endotsr.port.judge.command import run_port, write_requests
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.judge.verdict import declared, judge

SOURCES = golden_folder() / "ports" / "c99"
COMPILER = shutil.which("cc") or shutil.which("gcc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2"]
PORTED = {
    "reading", "generator", "frequencies", "dictionary", "atoms", "appearance", "motion", "matern", "laplacian",
    "calibration", "deformation", "covariance", "projection", "harmonics", "composite",
}  # fmt: skip

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc or gcc) on this machine")


def compiled(sources, folder, real):
    port = folder / f"port_{real}"
    files = sorted(map(str, sources.glob("*.c")))
    done = subprocess.run([str(COMPILER), *FLAGS, f"-DREAL={real}", "-o", str(port), *files, "-lm"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[:2000]
    return port


@pytest.mark.parametrize(("precision", "real"), [("float64", "double"), ("float32", "float")])
def test_the_port_passes_level_2(precision, real, tmp_path, capsys):
    port = compiled(SOURCES, tmp_path, real)
    words = ["--port", f"{port} {{requests}} {{outputs}}", "--precision", precision, "--keep", str(tmp_path / "run")]
    code = run(["run", *words, "--level", "2"])
    claim = capsys.readouterr().out.strip().splitlines()[-1]
    assert code == 0 and f", level 2, {precision}, without " in claim, claim
    golden = read_golden(golden_folder())
    without, notes = declared(golden, tmp_path / "run" / "outputs")
    up_to_2 = {case.operation for case in golden.cases if case.level <= 2}
    assert up_to_2 - set(without) == PORTED and not notes
    assert all(name in claim for name in up_to_2 - PORTED)


def test_requests_with_the_line_ends_of_windows_are_read_alike(tmp_path):
    requests, outputs, golden = tmp_path / "requests", tmp_path / "outputs", read_golden(golden_folder())
    write_requests(golden, requests, "float64", 2)
    for file in requests.rglob("*.json"):
        text = file.read_bytes()
        assert b"\r" not in text and b"\n" in text, "requests are written with LF everywhere"
        file.write_bytes(text.replace(b"\n", b"\r\n"))
    assert run_port(f"{compiled(SOURCES, tmp_path, 'double')} {{requests}} {{outputs}}", requests, outputs, 60) == ""
    assert judge(golden, outputs, "float64", level=2).level == 2


def test_a_mistake_in_its_source_is_named(tmp_path):
    sources, requests, outputs = tmp_path / "c99", tmp_path / "requests", tmp_path / "outputs"
    shutil.copytree(SOURCES, sources)
    file = sources / "composite.c"
    right, wrong = "dx = (real)x + (real)0.5 - s->u, dy = (real)y + (real)0.5 - s->v", "dx = x - s->u, dy = y - s->v"
    assert right in file.read_text()
    file.write_text(file.read_text().replace(right, wrong))
    golden = read_golden(golden_folder())
    write_requests(golden, requests, "float64", 1)
    assert run_port(f"{compiled(sources, tmp_path, 'double')} {{requests}} {{outputs}}", requests, outputs, 60) == ""
    report = judge(golden, outputs, "float64", level=1)
    refused = {case.name.split("/")[0] for case in report.cases if case.status == "refused"}
    assert refused == {"composite"} and report.level == 0
    assert report.suspects[0].flag == "pixel_corner_sample" and report.suspects[0].named
