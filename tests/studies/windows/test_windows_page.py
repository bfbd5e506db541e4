"""The page of a recording: small, with a script file for each window that it loads when the window is played."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from small_recording import FRAMES

from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.results.report.figures import bytes_image
from endotsr.results.views.page import about_frames, page
from endotsr.studies.windows.page import window_files, write_windows_page
from endotsr.studies.windows.scene import WindowFrames, open_windows

sys.path.insert(0, str(Path(__file__).parents[2] / "results" / "views"))
from browser import browser, dom, drawn

LEAST = 40.0  # dB of the page against the reference renderer


@pytest.fixture(scope="module")
def written(cold_run, tmp_path_factory):
    scene, file = open_windows(cold_run), tmp_path_factory.mktemp("page") / "a page.html"
    return scene, file, write_windows_page(file, scene, "two windows", 64, WindowFrames(scene))


def about(file):
    return json.loads(re.search(r'id="about">(.*?)</script>', file.read_text(), re.S)[1])


def script(file, name):
    """Number, object and Gaussians of the script file of a window."""
    found = re.fullmatch(r'endotsr_window\[(\d+)\]\((.*),"([\w+/=]*)"\);\n', (window_files(file) / name).read_text())
    return int(found[1]), json.loads(found[2]), found[3]


def test_the_page_holds_no_gaussian_and_each_window_stands_in_a_file(written, cold_run):
    scene, file, sizes = written
    assert sorted(path.name for path in window_files(file).iterdir()) == ["000.js", "001.js"]
    assert sizes.page == file.stat().st_size
    assert sizes.windows == [(window_files(file) / name).stat().st_size for name in ("000.js", "001.js")]
    text = file.read_text()
    assert '<script type="text/plain" id="data"></script>' in text and "http" not in re.sub(
        r'id="about">.*?<', "", text
    )
    found = about(file)
    assert [(span["begin"], span["end"]) for span in found["windows"]] == [(0, 32 / FRAMES), (24 / FRAMES, 1)]
    assert len(found["frames"]["names"]) == FRAMES and found["frames"]["numbers"] == scene.frames
    assert [frame["window"] for frame in found["held_out"]] == [0, 0, 0, 0, 1, 1, 1]
    for k, name in enumerate(("000.js", "001.js")):
        number, numbers, data = script(file, name)
        one = page(scene.window(k), "x", 64)
        assert number == k and data == re.search(r'id="data">(.*?)</script>', one, re.S)[1]
        assert numbers["times"][0] == pytest.approx(scene.plan.windows[k].first / FRAMES)
        assert numbers["times"][-1] == pytest.approx(scene.plan.windows[k].end / FRAMES)


def test_the_page_numbers_the_frames_as_the_recording_does(written):
    """Frames that a recording leaves out are no frames of the page; the others keep their numbers."""
    record = written[0].record
    assert about_frames(record, range(5, 5 + record.count))["frames"]["numbers"] == [*range(5, 5 + record.count)]


def test_a_held_out_frame_is_found_in_the_file_of_its_window(written):
    _, file, _ = written
    for frame in about(file)["held_out"]:
        row = script(file, f"{frame['window']:03d}.js")[1]["held_out"][frame["place"]]
        assert (
            row["name"] == frame["name"]
            and row["time"] == frame["time"]
            and row["picture"].startswith("data:image/png")
        )


def test_a_folder_with_other_files_is_not_replaced(written, cold_run, tmp_path):
    scene = written[0]
    folder = window_files(tmp_path / "a.html")
    folder.mkdir()
    (folder / "000.js").write_text("of an earlier page")
    (folder / "002.js").write_text("of an earlier page")
    write_windows_page(tmp_path / "a.html", scene, "a", 4)
    assert sorted(path.name for path in folder.iterdir()) == ["000.js", "001.js"]
    assert about(tmp_path / "a.html")["held_out"] == []
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds notes\.txt"):
        write_windows_page(tmp_path / "a.html", scene, "a", 4)
    assert (folder / "notes.txt").exists() and (folder / "001.js").exists()


def test_the_command_writes_it(cold_run, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert main(["export", str(cold_run), "--out", str(out), "--no-held-out", "--json", str(tmp_path / "a.json")]) == 0
    said = json.loads((tmp_path / "a.json").read_text())
    assert said["bytes"] == out.stat().st_size and len(said["windows"]) == 2 and not said["held_out"]
    assert "2 windows of at most" in capsys.readouterr().out


def test_python_writes_it_and_follows_points(cold_run, tmp_path):
    import endotsr

    run = endotsr.open_run(cold_run)
    assert run.view(tmp_path / "page.html") == tmp_path / "page.html"
    assert len(about(tmp_path / "page.html")["windows"]) == 2 and not about(tmp_path / "page.html")["held_out"]
    (tmp_path / "notes.html").write_text("mine")
    with pytest.raises(InputError, match="exists already, and does not show that endotsr wrote it; use another name"):
        run.view(tmp_path / "notes.html")
    assert not window_files(tmp_path / "notes.html").exists()
    run.view(tmp_path / "page.html")
    run.view(tmp_path / "notes.html", replace=True)
    points = run.scene.at(0.0).position[:, :4]
    assert np.isfinite(run.follow(points, 0, [0, 50])).all()
    with pytest.raises(InputError, match=r"name that ends in \.html"):
        run.view(tmp_path / "page")


def psnr(a, b):
    return -10 * np.log10(np.mean((a.astype(float) - b) ** 2) / 255**2)


@pytest.mark.slow
@pytest.mark.parametrize("frame", [4, 24, 26, 28, 30, 50])
def test_the_browser_draws_windows_and_their_blend_as_the_reference_does(written, frame):
    """Frames 24 to 31 are shown by both windows; what one of them alone shows is farther away."""
    browser()
    scene, file, _ = written
    camera = scene.cameras[frame]
    shown = drawn(file, f"t={frame / FRAMES}")
    assert psnr(shown, bytes_image(scene.render(frame / FRAMES, camera).colour)) > LEAST
    parts = scene.parts(frame)
    for part in parts if len(parts) > 1 and 0.2 < parts[1].weight < 0.8 else ():
        alone = bytes_image(scene.window(part.window).render(part.time, camera).colour)
        assert psnr(shown, alone) < psnr(shown, bytes_image(scene.render(frame / FRAMES, camera).colour)) - 3


@pytest.mark.slow
def test_a_page_loads_its_windows_under_any_name(written, tmp_path):
    """A number sign begins the fragment of an address, and a percent sign an escaped character."""
    browser()
    file = tmp_path / "case #3, 50%20 & more.html"
    write_windows_page(file, written[0], "a", 4)
    assert re.search(r'id="failure" hidden', dom(file, "t=0.9"))


@pytest.mark.slow
def test_a_window_that_is_missing_is_named_and_the_others_are_shown(written):
    browser()
    _, file, _ = written
    lost = window_files(file) / "001.js"
    content = lost.read_bytes()
    lost.unlink()
    try:
        said = re.search(r'id="failure"[^>]*>([^<]*)', dom(file, "t=0.9"))[1]
        fine = dom(file, "t=0.1")
    finally:
        lost.write_bytes(content)
    assert "001.js is missing" in said
    assert re.search(r'id="failure" hidden', fine) and "Camera view, nearest frame 000006" in fine


@pytest.mark.slow
def test_a_held_out_frame_of_another_window_is_shown_with_its_error(written):
    browser()
    _, file, _ = written
    content = dom(file, "held_out=6&layer=error&probe")
    name = about(file)["held_out"][6]["name"]
    assert f"Held-out frame {name}" in content
    chips = re.findall(r"<button[^>]*title=\"(\d+)\"[^>]*>0\.\d+</button>", content)
    assert chips == [frame["name"] for frame in about(file)["held_out"] if frame["window"] == 1]
