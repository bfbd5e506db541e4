"""The section of the report that shows held-out frames: render, truth, error and depth, worst first."""

import numpy as np

from endotsr.results.report import figures, parts
from endotsr.results.report.data import FramePictures, ReportData

OPENED_FRAMES = 3  # the worst frames are unfolded


def pictures(data: ReportData) -> str:
    """Render, truth, error and depth of the given held-out frames, worst first."""
    if not data.frames:
        return ""
    errors = [figures.tissue_error(f.render, f.truth, f.mask) for f in data.frames]
    scale = figures.error_scale(errors)
    order = sorted(range(len(errors)), key=lambda i: (-_squared(data.frames[i]), data.frames[i].index))
    depths = [f for f in data.frames if f.depth is not None]
    span = _depth_span(depths)
    legend = [f"Error {parts.colour_bar(figures.ERROR_MAP, '0', f'{scale:g} or more')}"]
    if depths:
        bar = parts.colour_bar(figures.DEPTH_MAP, f"{span[0]:.4g}", f"{span[1]:.4g} {data.depth_unit}")
        legend.append(f"Rendered depth {bar}")
    legend += [
        f"{words} {parts.colour_box(colour)}"
        for (times, colour), words in zip(figures.SELDOM_SEEN.items(), ("Never seen in training", "Seen once"))
        if any(f.seen is not None and (f.mask & (f.seen == times)).any() for f in data.frames)
    ]
    note = (
        "Worst first. Error: absolute difference, averaged over the colour channels, in display units from 0 to 1, "
        "with the same scale for all frames. Grey: excluded or without depth. The white border marks the window with "
        "the largest tissue error, enlarged 4×."
    )
    frames = len(data.evaluation.get("held_out", {}).get("per_frame", ()))
    if frames > len(data.frames):
        note = f"The {len(data.frames)} worst of {frames} frames; see renders/ for all of them. {note}"
    blocks = [_frame(data.frames[i], scale, span, position < OPENED_FRAMES) for position, i in enumerate(order)]
    return parts.section(
        "Pictures of the held-out frames", f'<div class="legend">{"".join(legend)}</div>', *blocks, note=note
    )


def _squared(frame: FramePictures) -> float:
    """Mean squared tissue error, for the order of the frames; infinite for a render that is not finite."""
    error = np.where(frame.mask, np.clip(frame.render, 0, 1) - frame.truth, 0.0)
    value = float(np.square(error, dtype=np.float64).sum() / max(3 * frame.mask.sum(), 1))
    return value if np.isfinite(value) else np.inf


def _depth_span(frames: list[FramePictures]) -> tuple[float, float]:
    spans = [figures.depth_range(f.depth, f.mask) for f in frames if f.depth is not None]
    return (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else (0.0, 1.0)


def _frame(frame: FramePictures, scale: float, span: tuple[float, float], opened: bool) -> str:
    panels = figures.triptych(frame.render, frame.truth, frame.mask, scale)
    views = [("Render", panels.render), ("Truth", panels.truth), ("Error", panels.error)]
    if frame.depth is not None:
        views.append(("Depth", figures.depth_picture(frame.depth, *span, mask=frame.mask)))
    seldom = 0 if frame.seen is None else int(np.count_nonzero(frame.mask & (frame.seen <= 1)))
    if seldom:
        views.append(("Seen", figures.seen_picture(frame.truth, frame.mask, frame.seen)))
    cells = []
    for label, picture in views:
        name = f"{label}, frame {frame.index}"
        whole = parts.image(figures.framed(picture, panels), name)
        inset = parts.image(panels.window(picture), f"{name}, enlarged", "inset")
        cells.append(f"<div>{whole}<span>{label}</span></div><div>{inset}<span>4×</span></div>")
    shown = [f"t = {frame.time:.3f}"]
    for key, before, digits, after in (("psnr_tissue", "tissue", 2, " dB"), ("ssim_tissue", "SSIM", 4, "")):
        if (value := (frame.metrics or {}).get(key)) is not None:
            shown.append(f"{before} {parts.number(value, digits)}{after}")
    if seldom:
        shown.append(f"{seldom} px never seen in training or once")
    facts = " · ".join([*shown, parts.text(frame.name)])
    summary = f"Frame {frame.index}<small>{facts}</small>"
    return parts.details(summary, f'<div class="views">{"".join(cells)}</div>', opened)
