"""The drawing page, driven in a headless browser by mouse, pen and keys: what is drawn is what the file gives."""

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
from drawing_page import HEIGHT, NAMES, SHIFT, WIDTH, Page, drawing

from endotsr.clips.masks.drawn_masks import key_masks
from endotsr.clips.masks.mask_shapes import MaskShape
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.errors import InputError
from endotsr.results.views.draw_page import check_draw_page, draw_page, write_draw_page

pytestmark = pytest.mark.slow  # a browser
PAINTED = f"""(() => {{
  const canvas = new OffscreenCanvas({WIDTH}, {HEIGHT}), c = canvas.getContext("2d");
  c.lineCap = c.lineJoin = "round";
  for (const shape of SHAPES) {{
    c.beginPath();
    for (const [x, y] of shape.points) c.lineTo(x, y);
    if (shape.tool === "polygon") c.fill("evenodd");
    else {{ c.lineWidth = 2 * shape.radius; c.stroke(); }}
  }}
  const data = [...c.getImageData(0, 0, {WIDTH}, {HEIGHT}).data];
  return data.filter((_, i) => i % 4 === 3).map((a) => +(a > 127)).join("");
}})()"""


@pytest.fixture
def opened(tmp_path, remote):
    write_draw_page(tmp_path / "draw.html", drawing(), "a clip", "endotsr masks clip --keys keys.json")
    return Page(remote.open(tmp_path / "draw.html", tmp_path), tmp_path)


def box(left, top, right, bottom) -> np.ndarray:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top:bottom, left:right] = True
    return mask


def overlap(one, other) -> float:
    return (one & other).sum() / (one | other).sum()


def test_polygons_brush_and_eraser_by_mouse(opened):
    opened.polygon((40, 40), (140, 40), (140, 100), (40, 100))
    opened.keys("b")
    opened.drag((60, 160), (200, 160))
    opened.keys("e")
    opened.drag((90, 20), (90, 130))
    opened.keys("np")
    opened.polygon((1, 220), (319, 220), (319, 239), (1, 239))  # snapped to the border
    found = opened.saved()
    assert [s.tool for s in found.keys[0].shapes] == ["polygon", "brush", "brush"] and len(found.keys) == 1
    masks = key_masks(found)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    stroke = np.hypot(rows - 160, columns - np.clip(columns, 60, 200)) <= 10
    wanted = (box(40, 40, 140, 100) | stroke) & ~((abs(columns - 90) <= 10) & (rows < 130))
    assert overlap(masks.keys[0], wanted) > 0.97
    assert masks.never is not None and overlap(masks.never, box(0, 220, 320, 240)) > 0.98


def test_what_the_page_shows_is_what_the_package_fills(opened):
    opened.drag((50, 50), (150, 60), (90, 140), (60, 60))
    opened.keys("b")
    opened.drag((200, 50), (250, 120))
    shapes = [{name: getattr(s, name) for name in s.__struct_fields__} for s in opened.saved().keys[0].shapes]
    shown = opened.remote.value(PAINTED.replace("SHAPES", json.dumps(shapes)))
    of_browser = np.array([letter == "1" for letter in shown]).reshape(HEIGHT, WIDTH)
    assert of_browser.sum() > 5000 and overlap(of_browser, key_masks(opened.saved()).keys[0]) > 0.985


def test_a_pen_draws_a_freehand_outline(opened):
    opened.drag((100, 60), (180, 60), (180, 140), (100, 140), (100, 62), pointer="pen")
    (shape,) = opened.saved().keys[0].shapes
    assert shape.tool == "polygon" and len(shape.points) > 10
    assert overlap(key_masks(opened.saved()).keys[0], box(100, 60, 180, 140)) > 0.97


def test_keys_alone_draw_undo_and_redo(opened):
    remote = opened.remote
    remote.value("document.getElementById('picture').focus()")
    for key, times in ((" ", 1), ("ArrowRight", 5), (" ", 1), ("ArrowDown", 5), (" ", 1), ("ArrowLeft", 5), (" ", 1)):
        remote.key(key, times, held="shift" if key != " " else "")
    remote.key("Enter")
    wanted = box(160, 120, 210, 170)
    assert overlap(key_masks(opened.saved()).keys[0], wanted) == 1
    opened.keys("b ")
    remote.key("ArrowUp", 6, held="shift")
    opened.keys(" ")
    assert len(opened.saved().keys[0].shapes) == 2
    opened.keys("z")
    np.testing.assert_array_equal(key_masks(opened.saved()).keys[0], wanted)
    opened.keys("zz")
    assert opened.saved().keys == []
    opened.keys("yy")
    assert len(opened.saved().keys[0].shapes) == 2
    remote.key("Delete")
    assert opened.saved().keys == []


def test_corners_can_be_taken_back_and_an_outline_given_up(opened):
    for corner in ((40, 40), (140, 40), (300, 200)):
        opened.remote.click(*opened.at(*corner))
    opened.remote.key("Backspace")
    opened.remote.click(*opened.at(140, 100))
    opened.remote.key("Enter")
    opened.remote.click(*opened.at(200, 200))
    opened.remote.key("Escape")
    (shape,) = opened.saved().keys[0].shapes
    np.testing.assert_allclose(shape.points, [(40, 40), (140, 40), (140, 100)], atol=0.6)


def test_copies_move_with_the_flow_and_are_adjusted(opened):
    opened.polygon((0, 40), (100, 40), (100, 100), (0, 100))
    opened.keys(".c")
    assert "Frame 2" in opened.said() and "drawn" in opened.said()
    (copied,) = opened.saved().keys[1].shapes
    assert copied.origin == "copied"
    np.testing.assert_allclose(
        copied.points, [(0, 48), (124, 48), (124, 108), (0, 108)], atol=0.8
    )  # still at the border
    opened.keys("m")
    opened.drag((124, 108), (150, 130))
    opened.drag((60, 70), (70, 70))
    (moved,) = opened.saved().keys[1].shapes
    np.testing.assert_allclose(moved.points, [(10, 48), (134, 48), (160, 130), (10, 108)], atol=1.5)
    opened.keys("..v")  # no drawn frame follows
    assert len(opened.saved().keys) == 2
    opened.keys("c")
    assert len(opened.saved().keys) == 3


def test_a_draft_is_used_only_when_it_is_accepted(opened):
    opened.keys(".")
    assert "Draft by colour" in opened.said() and opened.saved().keys == []
    opened.keys("a")
    (key,) = opened.saved().keys
    assert (key.frame, key.shapes[0].origin) == (2, "colour") and "Draft" not in opened.said()


def tinted(page: Page, folder: Path, x: float, y: float) -> bool:
    """Whether the window shows the colour of instruments at a point of the picture."""
    page.remote.picture(folder / "shot.png")
    column, row = (round(value) for value in page.at(x, y))
    red, green, _ = read_png(folder / "shot.png")[row - 2 : row + 3, column - 2 : column + 3].mean(axis=(0, 1))
    return bool(green > red + 40)


def test_a_mask_is_shown_on_its_own_frame_until_it_is_undone(opened, tmp_path):
    opened.polygon((40, 40), (140, 40), (140, 100), (40, 100))
    assert tinted(opened, tmp_path, 90, 70) and not tinted(opened, tmp_path, 200, 70)
    opened.keys("...")
    assert not tinted(opened, tmp_path, 90, 70)
    opened.keys(",,,")
    assert tinted(opened, tmp_path, 90, 70)
    opened.keys("z")
    assert not tinted(opened, tmp_path, 90, 70)


def test_a_frame_without_an_instrument_is_a_key(opened):
    opened.press("none")
    (key,) = opened.saved().keys
    assert key.shapes == [] and "no instrument" in opened.said()


def test_zoom_keeps_positions(opened):
    for _ in range(3):
        opened.remote.key("+")
    opened.drag((160, 120), (150, 110), button="right")
    opened.keys("0")
    opened.polygon((40, 40), (140, 40), (140, 100))
    np.testing.assert_allclose(opened.saved().keys[0].shapes[0].points, [(40, 40), (140, 40), (140, 100)], atol=0.6)


def test_names_of_the_clip_are_text_and_the_page_fits(opened):
    remote = opened.remote
    labels = remote.value("[...document.querySelectorAll('#strip button')].map((b) => b.children[1].textContent)")
    assert labels == NAMES and remote.value("document.title") == "a clip"
    for width in (1400, 800, 400):
        remote.size(width, 900)
        remote.until(f"window.innerWidth === {width}")
        assert remote.value("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0


def test_a_page_of_drawn_frames_continues_them(tmp_path, remote):
    old = [MaskShape(tool="polygon", points=[(40, 40), (140, 40), (140, 100)])]
    write_draw_page(tmp_path / "draw.html", drawing(old), "a clip", "x")
    page = Page(remote.open(tmp_path / "draw.html", tmp_path), tmp_path)
    assert "Frame 0" in page.said()
    page.polygon((10, 10), (60, 10), (60, 60))
    found = page.saved()
    assert [key.frame for key in found.keys] == [0, 4] and found.keys[1].shapes == old


def test_the_page_needs_nothing_else():
    text = draw_page(drawing(), 'a "<b>@SCRIPT@', "run <it>")
    assert (
        'a "<b>' not in text
        and "run <it>" not in text
        and text.count("a &quot;&lt;b&gt;@SCRIPT@") == 2
        and "<img src=x" not in text
    )
    assert not re.search(r'(src|href)\s*=\s*"(?!data:)|https?://|import\s*\(|@import|fetch\(', text)
    about = json.loads(html.unescape(re.search(r'id="about">(.*?)</script>', text, re.S)[1]))
    assert about["command"] == "run <it>" and about["frames"][1]["ahead"]["x"][0] == SHIFT[0]
    with pytest.raises(InputError, match=r"use a name that ends in \.html"):
        check_draw_page(Path("draw.png"))


def test_the_commands_draw_carry_and_draw_again(tmp_path, capsys):
    from common_folder import written

    from endotsr.api import load_sequence
    from endotsr.cli.main import main
    from endotsr.clips.sequences.sequence_file import read_sequence_file

    folder, page, keys = tmp_path / "clip", tmp_path / "draw.html", tmp_path / "keys.json"
    written(folder)
    assert main(["masks", str(folder), "--draw", str(page), "--key-frames", "3"]) == 0
    about = json.loads(re.search(r'id="about">(.*?)</script>', page.read_text(), re.S)[1])
    assert len(about["frames"]) == 3 and "3 frames to draw" in capsys.readouterr().out
    w, h = about["width"], about["height"]
    shape = {"tool": "polygon", "points": [[0, 0], [w / 2, 0], [w / 2, h], [0, h]]}
    drawn = [{"frame": f["frame"], "name": f["name"], "shapes": [shape]} for f in about["frames"][:2]]
    never = [shape | {"points": [[0, h - 4], [w, h - 4], [w, h], [0, h]]}]
    file = {"format": about["format"], "frames": about["count"], "width": w, "height": h, "keys": drawn, "never": never}
    keys.write_text(json.dumps(file))
    assert main(["masks", str(folder), "--keys", str(keys), "--margin", "0", "--replace"]) == 0
    assert "of the picture is never tissue" in capsys.readouterr().out
    mask = read_png(folder / "masks" / f"{drawn[0]['name']}.png") > 0
    origin = read_sequence_file(folder).masks.origin
    share = (w // 2) * (h - 4) / (w * h) / about["count"]
    assert origin.startswith(f"never tissue {4 / h:.1%}, drawn on 2 frames {2 * share:.1%}, carried ")
    assert f"masks: excluded pixels {origin}" in load_sequence(folder).notes
    assert main(["check", str(folder), "--html", str(tmp_path / "check.html")]) in (0, 1)
    assert f"excluded pixels {origin}" in (tmp_path / "check.html").read_text(encoding="utf-8")
    assert main(["prepare", str(folder), "--out", str(tmp_path / "copy")]) == 0
    assert read_sequence_file(tmp_path / "copy").masks.origin == origin
    capsys.readouterr()
    wanted = np.zeros((h, w), bool)
    wanted[:, : w // 2] = wanted[h - 4 :] = True
    np.testing.assert_array_equal(mask, wanted)
    assert main(["masks", str(folder), "--draw", str(page), "--keys", str(keys)]) == 0
    again = json.loads(re.search(r'id="about">(.*?)</script>', page.read_text(), re.S)[1])
    assert [f["frame"] for f in again["frames"] if f["key"]] == [key["frame"] for key in drawn] and again["never"]
    masks = tmp_path / "painted"
    masks.mkdir()
    write_png(masks / f"{drawn[0]['name']}.png", np.where(wanted, 255, 0).astype(np.uint8))
    assert main(["masks", str(folder), "--draw", str(page), "--keys", str(masks)]) == 0
    capsys.readouterr()
    assert main(["masks", str(folder), "--draw", str(page), "--margin", "3", "--keys", str(keys)]) == 2
    assert "--draw with --margin: the page writes no masks" in capsys.readouterr().err
