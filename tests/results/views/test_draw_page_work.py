"""What is drawn on the page is kept as it was drawn, and its file is read: zooms, keys, frames, long strokes."""

import re

import numpy as np
import pytest
from drawing_page import NAMES, Page, drawing

from endotsr.clips.masks import drawn_masks
from endotsr.clips.masks.drawn_masks import key_masks
from endotsr.clips.masks.mask_shapes import MOST_POINTS, MaskShape
from endotsr.results.views.draw_page import draw_page, write_draw_page

pytestmark = pytest.mark.slow  # a browser


@pytest.fixture
def opened(tmp_path, remote):
    write_draw_page(tmp_path / "draw.html", drawing(), "a clip", "endotsr masks clip --keys keys.json")
    return Page(remote.open(tmp_path / "draw.html", tmp_path), tmp_path)


def test_a_zoom_with_two_fingers_keeps_the_corners_that_are_set(opened):
    for corner in ((40, 40), (140, 40), (140, 100)):
        opened.remote.click(*opened.at(*corner))
    opened.remote.touch("touchStart", opened.at(100, 150))
    opened.remote.touch("touchStart", opened.at(100, 150), opened.at(140, 150))
    opened.remote.touch("touchMove", opened.at(80, 150), opened.at(160, 150))
    opened.remote.touch("touchEnd")
    opened.remote.key("Enter")
    (shape,) = opened.saved().keys[0].shapes
    np.testing.assert_allclose(shape.points, [(40, 40), (140, 40), (140, 100)], atol=0.6)


def drag_across_a_key(opened, columns, row):
    """A drag through three columns, with the key of the next frame pressed at the second."""
    first, second, third = columns
    opened.remote.mouse("Pressed", *opened.at(first, row))
    opened.remote.mouse("Moved", *opened.at(second, row))
    opened.keys(".")
    opened.remote.mouse("Moved", *opened.at(third, row))
    opened.remote.mouse("Released", *opened.at(third, row))


def test_what_is_drawn_stays_on_the_frame_on_which_it_began(opened):
    """A key during a stroke or an adjustment shows another frame: its shapes do not change."""
    opened.keys("b")
    drag_across_a_key(opened, (60, 120, 180), 60)
    opened.keys("p")
    opened.polygon((200, 150), (300, 150), (300, 200))
    opened.keys(",p")
    opened.polygon((40, 140), (140, 140), (140, 200))
    opened.keys("m")
    drag_across_a_key(opened, (120, 130, 200), 150)
    first, second = opened.saved().keys
    assert [s.tool for s in first.shapes] == ["brush", "polygon"] and len(second.shapes) == 1
    assert max(x for x, _ in first.shapes[0].points) < 130
    np.testing.assert_allclose(first.shapes[1].points, [(50, 140), (150, 140), (150, 200)], atol=1.2)
    np.testing.assert_allclose(second.shapes[0].points, [(200, 150), (300, 150), (300, 200)], atol=0.8)


def test_a_lowered_brush_is_part_of_the_saved_file(opened):
    opened.remote.value("document.getElementById('picture').focus()")
    opened.keys("b ")
    opened.remote.key("ArrowUp", 3, held="shift")
    assert len(opened.saved().keys[0].shapes) == 1
    opened.keys(" ")
    opened.remote.key("ArrowUp", 3, held="shift")
    opened.keys("z ")  # gives the stroke up, and lowers the brush again
    assert len(opened.saved().keys[0].shapes) == 2


def test_a_copy_of_a_frame_without_an_instrument_deletes_nothing(opened):
    opened.press("none")
    opened.keys(".")
    opened.polygon((40, 40), (140, 40), (140, 100))
    opened.keys("c")
    assert len(opened.saved().keys[1].shapes) == 1
    opened.remote.key("Delete")
    opened.keys("c")
    found = opened.saved()
    assert [key.frame for key in found.keys] == [0, 2] and found.keys[1].shapes == []


def test_an_eraser_on_an_empty_frame_makes_no_key(opened):
    """The frame would count as one without an instrument."""
    opened.keys("e")
    opened.drag((60, 60), (120, 60))
    assert opened.saved().keys == [] and "not drawn" in opened.said()


def test_a_frame_that_was_said_to_have_no_instrument_is_cleared(opened):
    opened.press("none")
    assert len(opened.saved().keys) == 1
    opened.press("clear")
    assert opened.saved().keys == [] and "not drawn" in opened.said()


LEAVING = "!window.dispatchEvent(new Event('beforeunload', {cancelable: true}))"


def test_an_outline_that_is_not_closed_is_no_saved_work(opened):
    assert not opened.remote.value(LEAVING)
    opened.remote.click(*opened.at(40, 40))
    assert opened.remote.value(LEAVING)
    opened.remote.key("Escape")
    assert not opened.remote.value(LEAVING)


HELD = """((key) => { for (const repeat of [false, true, true]) document.getElementById('picture').dispatchEvent(
  new KeyboardEvent('keydown', {key, repeat, bubbles: true, cancelable: true})); })"""


def test_a_key_that_is_held_acts_once(opened):
    opened.polygon((40, 40), (140, 40), (140, 100))
    opened.keys(".")
    opened.remote.value(f"{HELD}('c')")
    assert len(opened.saved().keys[1].shapes) == 1
    opened.keys("..b")
    opened.remote.value(f"{HELD}(' ')")
    opened.remote.key("ArrowUp", 3, held="shift")
    opened.keys(" ")
    (stroke,) = opened.saved().keys[2].shapes
    assert len(stroke.points) > 1


@pytest.mark.parametrize("key", ["b", "p"])
def test_a_long_stroke_is_a_file_that_is_read(key, opened):
    """A shape of the file has at most 5000 points."""
    opened.keys(key)
    opened.remote.mouse("Pressed", *opened.at(20, 20))
    x0, y0 = opened.at(20, 20)
    scribble = f"""(() => {{ const c = document.getElementById('picture');
      for (let i = 0; i < 6000; i++) c.dispatchEvent(new PointerEvent('pointermove', {{pointerId: 1, buttons: 1,
        clientX: {x0} + (i % 2) * 300, clientY: {y0} + i / 20}})); }})()"""
    opened.remote.value(
        f"for (const f of ['stroke', 'lineTo']) CanvasRenderingContext2D.prototype[f] = () => 0; {scribble}"
    )
    opened.remote.mouse("Released", *opened.at(20, 160))
    found = opened.saved()
    assert sum(len(shape.points) for shape in found.keys[0].shapes) > 2500
    if key == "b":
        assert len(found.keys[0].shapes) == 2
        assert found.keys[0].shapes[0].points[-1] == found.keys[0].shapes[1].points[0]
        assert key_masks(found).keys[0][:, 30:100].any(axis=1).sum() > 100
        opened.keys("z")
        assert opened.saved().keys == []


def test_the_page_divides_a_stroke_where_the_file_ends_it():
    text = draw_page(drawing(), "a", "b")
    assert int(re.search(r"MOST_POINTS = (\d+)", text)[1]) == MOST_POINTS
    assert int(re.search(r"MOST_OF_FILE = (\d+)", text)[1]) == drawn_masks.MOST_POINTS


def test_the_page_says_that_its_file_has_too_many_points(tmp_path, remote):
    many = MaskShape(tool="polygon", points=[(40 + k / 50, 40 + k % 2) for k in range(5000)])
    for count, said in ((20, False), (21, True)):
        write_draw_page(tmp_path / "draw.html", drawing([many] * count), "a clip", "x")
        page = Page(remote.open(tmp_path / "draw.html", tmp_path), tmp_path)
        assert ("105000 points: the command reads a file of at most 100000" in page.said()) is said


def test_frames_of_long_names_are_as_wide_as_the_others(opened):
    widths = opened.remote.value("[...document.querySelectorAll('#strip button')].map((b) => b.offsetWidth)")
    titles = opened.remote.value("[...document.querySelectorAll('#strip button')].map((b) => b.title)")
    assert len(set(widths)) == 1 and titles == NAMES


def test_a_zoom_stays_when_the_window_changes(opened):
    """A phone changes the height of the window when its bar of addresses goes; the picture jumped under the pen."""
    remote = opened.remote
    middle = "(({left, top, width, height}) => [left + width / 2, top + height / 2])"
    middle += "(document.getElementById('picture').getBoundingClientRect())"
    for _ in range(4):
        remote.key("+")
    opened.drag((160, 120), (130, 100), button="right")
    for width, height in ((1400, 900), (1000, 700)):
        remote.size(width, height)
        remote.until(f"window.innerWidth === {width}")
        remote.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        x, y = remote.value(middle)
        for dx, dy in ((0, 0), (60, 0), (60, 60)):
            remote.click(x + dx, y + dy)
        remote.key("Enter")
    before, after = (np.array(shape.points) for shape in opened.saved().keys[0].shapes)
    np.testing.assert_allclose(after[0], before[0], atol=1.5)
    assert before[0][0] > 165 and after[1][0] - after[0][0] < 60 / opened.fit() / 2
