"""`endotsr --cache`: what is kept outside run folders is shown, and removed when asked."""

import pytest
from tiny import assert_refused

from endotsr.cli.main import main
from endotsr.cli.parts import kept


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home with the kernels of two versions, and another folder of compiled kernels beside it."""
    for name in ("kernels/a/deep", "kernels/b", "other"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "kernel.nbc").write_bytes(bytes(2_000_000))
    monkeypatch.setattr(kept, "user_cache_dir", lambda _: str(tmp_path))
    monkeypatch.setattr(kept, "flow_folder", lambda: tmp_path / "flows")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "other"))
    return tmp_path


def test_what_is_kept_is_shown_and_removed(home, capsys):
    kernels = f"{home / 'kernels'}: compiled kernels of 2 versions of this package, 4 MB"
    assert main(["--cache"]) == 0
    assert capsys.readouterr().out == f"{kernels}\n{home / 'other'}: compiled kernels, 2 MB (NUMBA_CACHE_DIR)\n"
    assert main(["--cache", "clear"]) == 0
    assert capsys.readouterr().out.startswith(f"{kernels}; removed\n")
    assert not list((home / "kernels").iterdir()) and (home / "other" / "kernel.nbc").exists()
    assert main(["--cache"]) == 0
    assert "of 0 versions of this package, 0 MB" in capsys.readouterr().out


def test_the_flows_of_clips_are_shown_and_removed(home, capsys):
    (home / "flows").mkdir()
    (home / "flows" / "clip.npy").write_bytes(bytes(3_000_000))
    line = f"{home / 'flows'}: flows of 1 clips, 3 MB"
    assert main(["--cache"]) == 0 and f"{line}\n" in capsys.readouterr().out
    assert main(["--cache", "clear"]) == 0 and f"{line}; removed\n" in capsys.readouterr().out
    assert not (home / "flows").exists()


def test_another_word_is_refused(home, capsys):
    assert_refused(capsys, ["--cache", "all"], "--cache 'all' is not allowed; use --cache alone, or --cache clear")
    assert len(list((home / "kernels").iterdir())) == 2
