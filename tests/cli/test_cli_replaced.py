"""A command replaces a file that endotsr wrote, and no other one."""

import shutil

import numpy as np
import pytest
from tiny import assert_refused, scene

from endotsr.cli.main import main
from endotsr.clips.formats.film_file import write_video
from endotsr.errors import InputError
from endotsr.untrusted.marks import own, refuse_foreign

FOREIGN = "does not show that endotsr wrote it; use another name"
EXPORTS = ("a.ply", "a.glb", "a.npz", "a.html")
NOTES = b"notes of a user\n"


def spared(capsys, file, words: list[str], *named: str) -> None:
    """The command refuses to replace a file of the user, which is unchanged, and nothing else is written."""
    file.write_bytes(NOTES)
    before = sorted(file.parent.rglob("*"))
    assert_refused(capsys, words, f"{file}: exists already, and {FOREIGN}", *named)
    assert file.read_bytes() == NOTES and sorted(file.parent.rglob("*")) == before


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_replaces_an_export_and_no_file_of_the_user(name, finished_run, tmp_path, capsys):
    file = tmp_path / name
    words = ["export", str(finished_run), "--out", str(file)]
    spared(capsys, file, words, "--out ", ", or --replace")
    assert main([*words, "--replace"]) == 0 and own(file)
    written = file.read_bytes()
    assert main(words) == 0 and file.read_bytes() == written, "its own file is replaced without a word"


def test_a_page_to_draw_on_replaces_another_and_no_file_of_the_user(tmp_path, capsys):
    clip = scene(tmp_path / "clip")
    words = ["masks", str(clip), "--draw", str(tmp_path / "draw.html"), "--key-frames", "2"]
    spared(capsys, tmp_path / "draw.html", words, "--draw ")
    (tmp_path / "draw.html").unlink()
    assert main(words) == 0 and main(words) == 0


@pytest.mark.parametrize("name", ["a.gif", "a.mp4", "a.webm"])
def test_a_film_replaces_a_film_of_endotsr_and_no_other_one(name, finished_run, tmp_path, capsys):
    file = tmp_path / name
    words = ["render", str(finished_run), "--film", str(file), "--times", "0", "0.5"]
    spared(capsys, file, words, "--film ", ", or --replace")
    assert main([*words, "--replace"]) == 0 and own(file) and main(words) == 0


def test_a_recording_is_no_film_of_endotsr(finished_run, tmp_path, capsys):
    for name in ("a.mp4", "a.webm"):
        write_video(tmp_path / name, [np.zeros((32, 32, 3), np.uint8)] * 2, 10.0)
        words = ["render", str(finished_run), "--film", str(tmp_path / name), "--times", "0", "0.5"]
        assert_refused(capsys, words, FOREIGN)


def test_no_export_replaces_a_page_of_a_run(run_copy, capsys):
    for name in ("report.html", "view.html", "training.html"):
        page = run_copy / name
        before = page.read_bytes()
        for more in ([], ["--replace"]):
            words = ["export", str(run_copy), "--out", str(page), *more]
            assert_refused(
                capsys, words, f"{name}: would be replaced, but belongs to the folder of run.json; use another"
            )
        assert page.read_bytes() == before


def test_a_checkpoint_is_no_slim_model(finished_run, tmp_path, capsys):
    kept = shutil.copy(finished_run / "checkpoint.npz", tmp_path / "kept.npz")
    assert_refused(capsys, ["export", str(finished_run), "--out", str(kept)], FOREIGN)


def test_tables_of_a_sweep_replace_no_file_of_the_user(tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "s.toml").write_text(f'sequences = ["{scene()}"]\nseeds = [0]\n[configurations.a]\n')
    for name, words in {
        "results.csv": ["sweep", str(tmp_path / "s.toml")], "ablation.md": ["ablate", "simulated", "--collect"],
        "tradeoff.html": ["tradeoff", "--scale", "0.2"],
    }.items():  # fmt: skip
        (out / name).write_bytes(NOTES)
        said = f"{name}: exists already, and does not show that endotsr wrote it; choose another --out"
        assert_refused(capsys, [*words, "--out", str(out)], said)
        assert [file.name for file in out.iterdir()] == [name] and (out / name).read_bytes() == NOTES
        (out / name).unlink()
    (out / "results.json").mkdir()
    assert_refused(capsys, ["sweep", str(tmp_path / "s.toml"), "--out", str(out)], "results.json: cannot be read")
    assert [file.name for file in out.iterdir()] == ["results.json"]


def test_tables_of_a_sweep_are_written_again_beside_its_runs(tmp_path):
    """They have no mark: the folder of the runs shows their origin, as the record of a trade-off does for its page."""
    table, runs = tmp_path / "results.csv", tmp_path / "runs"
    table.write_bytes(NOTES)
    with pytest.raises(InputError, match="choose another --out"):
        refuse_foreign(table, beside=runs)
    runs.mkdir()
    refuse_foreign(table, beside=runs)
