"""The style of all charts: legible colours, and files that depend on nothing but the numbers."""

import numpy as np
import pytest

from endotsr.results.report.style import DARK, LIGHT, encoded, legend, name_axes, new_figure, plain_axes, save


def drawing():
    figure = new_figure(3, 2)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=LIGHT.colours[0], label="a curve", clip_on=True)
    name_axes(axes, "x", "y", "title")
    plain_axes(axes)
    legend(axes)
    return figure


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.1."""
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize(("theme", "ground"), [(LIGHT, "#ffffff"), (DARK, "#182026")])
def test_words_and_curves_are_seen_on_their_ground(theme, ground):
    """WCAG 2.1 asks a contrast of 4.5 of words and 3 of lines."""
    assert contrast(theme.ink, ground) > 7 and contrast(theme.grey, ground) > 4.5
    assert min(contrast(colour, ground) for colour in theme.colours) > 3
    assert len(set(theme.colours)) == 6
    assert contrast(theme.faint, ground) < 2  # a grid stays behind the curves


def test_axes_have_a_grid_and_no_frame():
    (axes,) = drawing().axes
    assert not any(side.get_visible() for side in axes.spines.values())
    assert axes.xaxis.get_gridlines()[0].get_color() == LIGHT.faint and axes.get_axisbelow()
    assert axes.get_title(loc="left") == "title" and axes.get_legend().get_frame_on() is False


@pytest.mark.parametrize(("kind", "begin"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_equal_drawings_give_equal_files(kind, begin, tmp_path):
    file = tmp_path / f"one.{kind}"
    save(drawing(), file)
    assert file.read_bytes() == encoded(drawing(), kind)
    assert file.read_bytes().startswith(begin) and b"Matplotlib v" not in file.read_bytes()
    assert list(tmp_path.iterdir()) == [file]
