"""The port in C99, written from the text alone: it must compile without a warning and pass level 2."""

import shutil
import subprocess

import pytest

from endotsr.cli.golden import run
from endotsr.port.judge.certificate import read_certificate
from endotsr.port.judge.command import run_port, write_requests
from endotsr.port.judge.store import golden_folder
from endotsr.port.judge.verdict import declared, judge

SOURCES = golden_folder() / "ports" / "c99"
COMPILER = shutil.which("cc") or shutil.which("gcc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2"]
PORTED = {
    "reading", "generator", "frequencies", "dictionary", "atoms", "appearance", "motion", "matern", "laplacian",
    "calibration", "deformation", "covariance", "projection", "harmonics", "composite",
    "masked_l1", "masked_ssim", "normalised_depth", "smoothness",
}  # fmt: skip

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc or gcc) on this machine")


def compiled(sources, folder, real, *, strict=True):
    """The program; what a part leaves out may leave functions without a use."""
    flags = FLAGS if strict else ["-std=c99", "-O2"]
    port = folder / f"port_{real}"
    files = sorted(map(str, sources.glob("*.c")))
    done = subprocess.run([str(COMPILER), *flags, f"-DREAL={real}", "-o", str(port), *files, "-lm"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[:2000]
    return port


@pytest.mark.parametrize(("precision", "real"), [("float64", "double"), ("float32", "float")])
def test_the_port_passes_level_2(precision, real, golden, tmp_path, capsys):
    port = compiled(SOURCES, tmp_path, real)
    words = ["--port", f"{port} {{requests}} {{outputs}}", "--precision", precision, "--keep", str(tmp_path / "run")]
    code = run(["run", *words, "--level", "2"])
    claim = capsys.readouterr().out.strip().splitlines()[-1]
    assert code == 0 and f", level 2, {precision}, without " in claim, claim
    without, notes = declared(golden, tmp_path / "run" / "outputs")
    up_to_2 = {case.operation for case in golden.cases if case.level <= 2}
    assert up_to_2 - set(without) == PORTED and not notes
    assert all(name in claim for name in up_to_2 - PORTED)


def test_requests_with_the_line_ends_of_windows_are_read_alike(golden, tmp_path):
    requests, outputs = tmp_path / "requests", tmp_path / "outputs"
    write_requests(golden, requests, "float64", 2)
    for file in requests.rglob("*.json"):
        text = file.read_bytes()
        assert b"\r" not in text and b"\n" in text, "requests are written with LF everywhere"
        file.write_bytes(text.replace(b"\n", b"\r\n"))
    assert run_port(f"{compiled(SOURCES, tmp_path, 'double')} {{requests}} {{outputs}}", requests, outputs, 60) == ""
    assert judge(golden, outputs, "float64", level=2).level == 2


def with_edits(folder, edits):
    """The sources of the port with some text of composite.c taken out or replaced."""
    sources = shutil.copytree(SOURCES, folder / "c99")
    file = sources / "composite.c"
    for old, new in edits:
        assert file.read_text().count(old) == 1
        file.write_text(file.read_text().replace(old, new))
    return sources


def test_a_mistake_in_its_source_is_named(golden, tmp_path):
    requests, outputs = tmp_path / "requests", tmp_path / "outputs"
    right, wrong = "dx = (real)x + (real)0.5 - s->u, dy = (real)y + (real)0.5 - s->v", "dx = x - s->u, dy = y - s->v"
    sources = with_edits(tmp_path, [(right, wrong)])
    write_requests(golden, requests, "float64", 1)
    assert run_port(f"{compiled(sources, tmp_path, 'double')} {{requests}} {{outputs}}", requests, outputs, 60) == ""
    report = judge(golden, outputs, "float64", level=1)
    refused = {case.name.split("/")[0] for case in report.cases if case.status == "refused"}
    assert refused == {"composite"} and report.level == 0
    assert report.suspects[0].flag == "pixel_corner_sample" and report.suspects[0].named


def part(folder, kept, edits=()):
    """The port with these operations alone in its table, and these edits."""
    sources = with_edits(folder, edits)
    main = sources / "main.c"
    text, (head, rest) = main.read_text(), main.read_text().split("OPERATIONS[] = {\n")
    rows = "".join(f'    {{"{name}", {name}}},\n' for name in kept)
    main.write_text(f"{head}OPERATIONS[] = {{\n{rows}}};{rest.partition('};')[2]}")
    assert main.read_text() != text
    return sources


RENDERER = ("reading", "generator", "covariance", "projection", "harmonics", "composite", "render")
LOSSES = ("reading", "generator", "masked_l1", "masked_ssim", "normalised_depth", "smoothness", "laplacian", "matern")
NO_REVERSE = (
    ("        pixel_reverse(hits, found, &rules, background, g, sums);\n", ""),
    ("    write_gradients(request, splats, sums, &rules, n);\n", ""),
)
TEXTBOOK = (  # the conic of most CUDA kernels
    ("exp(-(s->r * dy * dy + s->a_big * eta * eta) / 2)",
     "exp(-(s->c * dx * dx - 2 * s->b * dx * dy + s->a * dy * dy) / (s->a * s->c - s->b * s->b) / 2)"),
)  # fmt: skip


@pytest.mark.parametrize(("precision", "real"), [("float64", "double"), ("float32", "float")])
@pytest.mark.parametrize(
    ("profile", "kept", "edits", "said"),
    [
        ("renderer-forward", RENDERER, NO_REVERSE, "renderer (forward), level 3"),
        ("losses", LOSSES, (), "losses, level 2"),
    ],
)
def test_a_port_of_a_part_claims_this_part(tmp_path, capsys, profile, kept, edits, said, precision, real):
    sources = part(tmp_path, kept, edits)
    port = compiled(sources, tmp_path, real, strict=False)
    certificate = tmp_path / "c.json"
    words = ["--port", f"{port} {{requests}} {{outputs}}", "--precision", precision, "--profile", profile]
    assert run(["run", *words, "--certificate", str(certificate)]) == 0
    text = capsys.readouterr().out
    assert text.splitlines()[-1].endswith(f"{said}, {precision}") and f"  {said}: " in text
    assert read_certificate(certificate).profile == profile
    assert run(["run", *words[:-1], "method", "--search", "0"]) == 1


def test_a_port_with_the_textbook_conic_is_told_that_only_needles_fail(tmp_path, capsys):
    port = compiled(part(tmp_path, RENDERER, TEXTBOOK), tmp_path, "float", strict=False)
    words = ["--port", f"{port} {{requests}} {{outputs}}", "--precision", "float32", "--profile", "renderer-forward"]
    assert run(["run", *words, "--search", "0"]) == 1
    first, rewrite = capsys.readouterr().out.splitlines()[:2]
    assert first.startswith("only needles fail: render/long_needle, ") and "times the tolerance" in first
    assert "sum of squares" in rewrite
