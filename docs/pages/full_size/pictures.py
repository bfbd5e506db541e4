"""Pictures of the page on a clip at full size: crops of a held-out frame, error maps, curves over the frames."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.report.figures import (
    ERROR_MAP,
    EXCLUDED,
    ByteImage,
    bytes_image,
    colour_mapped,
    tissue_error,
    worst_window,
)
from endotsr.results.report.style import GREY, LIGHT, SMALL, legend, name_axes, new_figure, plain_axes
from pages.full_size.text import LABELS, PREDICTIONS, PRESETS, SPLITS, psnr

WINDOW = 128, 160  # rows and columns of a crop
BRIGHTEST = 0.06  # error in the brightest colour, display units
LONGEST_STEP = 8  # frames between two points of one line
LINES = {"nearest_frame": ":", "two_neighbours": "--", "flow_interpolation": "-."}


def sample_picture(
    sequence: Sequence, index: int, predict: Mapping[str, Callable[[int], FloatArray]]
) -> NDArray[np.uint8]:
    """Truth and predictions of a held-out frame around the model's largest error, with the error of each below."""
    truth, tissue = unit_image(sequence, index), sequence.masks[index]
    images = {name: predict[name](index) for name in PREDICTIONS}
    errors = {name: tissue_error(image, truth, tissue) for name, image in images.items()}
    row, column = worst_window(errors["model"], *WINDOW)
    window = slice(row, row + WINDOW[0]), slice(column, column + WINDOW[1])
    figure = new_figure(10.0, 3.55)
    panels = figure.subplots(2, len(images) + 1)
    _show(panels[0, 0], bytes_image(truth)[window], f"held-out frame {index}")
    _show(panels[1, 0], _where(bytes_image(truth), window), "the place of the crops")
    for (top, below), (name, image) in zip(panels.T[1:], images.items(), strict=True):
        _show(top, bytes_image(image)[window], LABELS[name])
        value = psnr(float(np.square(np.where(tissue, image - truth, 0)).mean(axis=0)[tissue].mean()))
        _show(below, _map(errors[name], tissue)[window], f"error; whole frame {value:.2f} dB")
    return _drawn(figure)


def maps_picture(roots: dict[str, NDArray[np.float64]]) -> NDArray[np.uint8]:
    """Root of the mean squared error over the held-out frames, pixel by pixel, one map for every prediction.

    roots   prediction -> (H, W) display units, 0 where no held-out frame shows tissue
    """
    figure = new_figure(10.0, 2.35)
    for axes, (name, root) in zip(figure.subplots(1, len(roots)), roots.items(), strict=True):
        _show(axes, _map(root, root > 0)[::2, ::2], LABELS[name])
    return _drawn(figure)


def curves_figure(runs: dict[str, Any]) -> Any:
    """PSNR over the tissue of every held-out frame: one panel per split; the line of a model is solid.

    A preset has one colour in all panels, and the legend has every preset.
    """
    splits = [split for split in SPLITS if any(run["split"] == split for run in runs.values())]
    figure = new_figure(10.0, 3.4)
    for axes, split in zip(figure.subplots(1, len(splits), sharey=True, squeeze=False)[0], splits, strict=True):
        same = [run for run in runs.values() if run["split"] == split]
        for run in same:
            _curve(axes, run, "model", run["preset"], "-", LIGHT.colours[PRESETS.index(run["preset"])])
        for (name, line), grey in zip(LINES.items(), (GREY, "#000000", "#8a6d3b"), strict=True):
            _curve(axes, same[0], name, LABELS[name], line, grey)
        axes.axhline(psnr(same[0]["noise"] ** 2), color=GREY, linewidth=0.8)
        text = "noise of the frame alone"
        axes.annotate(text, (0, psnr(same[0]["noise"] ** 2)), xytext=(2, 3), textcoords="offset points", fontsize=8)
        plain_axes(axes, sizes=SMALL)
        name_axes(axes, "frame", title=SPLITS[split], sizes=SMALL)
    name_axes(figure.axes[0], y="PSNR of the tissue, dB", sizes=SMALL)
    named = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    legend(figure, sizes=SMALL, loc="outside lower center", ncols=6, handles=[*named.values()], labels=[*named])
    return figure


def _curve(axes: Any, run: dict[str, Any], name: str, label: str, line: str, colour: str) -> None:
    frames = np.array([row["frame"] for row in run["frames"]], float)
    values = np.array([psnr(row["squared_error"][name]) for row in run["frames"]])
    ends = np.flatnonzero(np.diff(frames) > LONGEST_STEP) + 1  # the line does not join the blocks
    frames, values = np.insert(frames, ends, np.nan), np.insert(values, ends, np.nan)
    axes.plot(frames, values, linestyle=line, color=colour, marker="o", markersize=3, linewidth=1.4, label=label)


def _map(error: FloatArray, tissue: NDArray[np.bool_]) -> ByteImage:
    """The error in colours from 0 to BRIGHTEST, excluded pixels grey."""
    colours = colour_mapped(error, 0.0, BRIGHTEST, ERROR_MAP)
    colours[~tissue] = EXCLUDED
    return colours


def _where(image: ByteImage, window: tuple[slice, slice]) -> ByteImage:
    """The whole frame, reduced, with a white frame on black around the window."""
    out = image.copy()
    rows, columns = window
    for grow, colour in ((8, 0), (4, 255)):
        out[max(rows.start - grow, 0) : rows.stop + grow, max(columns.start - grow, 0) : columns.stop + grow] = colour
    out[window] = image[window]
    return out[::2, ::2]


def _show(axes: Any, image: ByteImage, title: str) -> None:
    axes.imshow(image, interpolation="nearest")
    axes.set_axis_off()
    name_axes(axes, title=title, sizes=SMALL)


def _drawn(figure: Any) -> NDArray[np.uint8]:
    """The pixels of a figure, (H, W, 3)."""
    figure.set_dpi(120)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()
